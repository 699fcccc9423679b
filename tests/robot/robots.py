"""Small robots written by tests."""

from pathlib import Path

LINK = '<link name="{0}"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>'
BARE = '<link name="{0}"/>'
LIMIT = '<limit lower="-1" upper="2" velocity="3" effort="4"/>'


def joint(name: str, parent: str, child: str, kind: str = "revolute", inside: str = LIMIT, x: float = 0.5) -> str:
    """A joint about the z axis of its child, `x` metres from its parent."""
    ends = f'<origin xyz="{x} 0 0"/><parent link="{parent}"/><child link="{child}"/><axis xyz="0 0 1"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


BODILESS = "collision: none\n"
"""What a robot file says of a robot without bodies."""


def write_robot(folder: Path, parts: list[str], yaml: str = "") -> Path:
    """A robot folder; `yaml` is added to the three keys that must be there."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.urdf").write_text(f'<robot name="r">{"".join(parts)}</robot>')
    (folder / "robot.yaml").write_text(f"version: 1\nname: r\nurdf: robot.urdf\n{yaml}")
    return folder / "robot.yaml"


def chain(*joints: str) -> list[str]:
    """Links a, b, c, … with boxes, and the given joints."""
    return [*(LINK.format(name) for name in "abcd"[: len(joints) + 1]), *joints]


TWO = chain(joint("j1", "a", "b"), joint("j2", "b", "c"))
