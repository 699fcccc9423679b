"""The service page's lines for curl, run as they stand: the motion that a server returns verifies offline."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
def test_curl_submits_and_the_motion_verifies_offline(server, tmp_path):
    readme = (ROOT / "README.md").read_text("utf-8")
    (tmp_path / "pillar.yaml").write_text(re.search(r"```yaml\n(.*?)```", readme, re.DOTALL)[1])
    page = (ROOT / "docs" / "service.md").read_text("utf-8")
    block = next(part for part in re.findall(r"```sh\n(.*?)```", page, re.DOTALL) if "/api/runs" in part)
    lines = [line for line in block.splitlines() if not line.startswith("optiplan serve")]
    program = f'"{sys.executable}" -c "from optiplan.cli.main import main; main()"'
    script = (
        "\n".join(lines).replace("http://127.0.0.1:7100", server.url).replace("optiplan verify", f"{program} verify")
    )
    environment = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "HOME": str(tmp_path)}
    done = subprocess.run(["bash", "-euc", script], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "event: end" in done.stdout
    assert "verified · around-a-pillar" in done.stdout


@pytest.mark.parametrize(("query", "status"), [("budget=1&planner=cubic", 202), ("budget=x", 422), ("nonsense=1", 422)])
def test_yaml_bodies_say_the_rest_in_the_query(server, query, status):
    from tests.small_problems import QUICK

    headers = {"Content-Type": "application/yaml; charset=utf-8"}
    answer = server.http.post(f"/api/runs?{query}", content=QUICK.encode(), headers=headers)
    assert answer.status_code == status
    if status == 202:
        assert answer.json()["planner"] == "cubic"
    assert server.http.post("/api/runs", content=b"\xff\xfe", headers=headers).status_code == 422
