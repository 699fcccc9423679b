"""Files of samples that hold no motion."""

import json

import pytest

from optiplan.errors import InputError
from optiplan.trajectory.sample_file import read_samples


@pytest.mark.parametrize("without", ["t", "q"])
@pytest.mark.parametrize("value", [None, "", "x"])
def test_samples_without_times_or_positions_are_refused(tmp_path, without, value):
    file = tmp_path / "motion.json"
    file.write_text(json.dumps({"joint_names": ["a"], "t": [0, 1], "q": [[0], [1]], without: value}))
    with pytest.raises(InputError, match=r"motion\.json: (t, )?q|t: "):
        read_samples(file)
