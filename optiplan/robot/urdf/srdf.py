"""SRDF files: pairs of links that need no check, and named states."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from optiplan.config.messages import one_line
from optiplan.robot.urdf.elements import parsed_xml, xml_text

LinkPair = tuple[str, str]
"""Two link names in alphabetical order."""


class Srdf(NamedTuple):
    """Content of an SRDF: reasons of disabled pairs by (sorted) link names, states with their names, remarks.

    A name may come several times: each group has states of its own.
    """

    disabled: Mapping[LinkPair, str]
    states: Sequence[tuple[str, Mapping[str, float]]]
    notes: Sequence[str]


def link_pair(a: str, b: str) -> LinkPair:
    """The two names in order: the key of an unordered pair."""
    return (a, b) if a < b else (b, a)


def read_srdf(path: Path, renamed: Mapping[str, str]) -> Srdf:
    """Read `disable_collisions` and `group_state` of an SRDF; links in `renamed` get their new names.

    Raises:
        InputError: a missing file or broken XML.
    """
    root = parsed_xml(path, "srdf")
    disabled = {}
    for item in root.iter("disable_collisions"):
        a, b = (renamed.get(name, name) for name in (item.get("link1", ""), item.get("link2", "")))
        disabled[link_pair(a, b)] = one_line(item.get("reason") or "User")
    notes: list[str] = []
    return Srdf(disabled, _states(root, notes), notes)


def srdf_text(name: str, allowed: Mapping[LinkPair, str]) -> str:
    """An SRDF of the robot called `name` that disables the pairs in `allowed`, with their reasons."""
    root = ET.Element("robot", name=name)
    for (a, b), reason in sorted(allowed.items()):
        ET.SubElement(root, "disable_collisions", link1=a, link2=b, reason=reason)
    ET.indent(root)
    return xml_text(root)


def _states(root: ET.Element, notes: list[str]) -> list[tuple[str, dict[str, float]]]:
    states = []
    for state in root.iter("group_state"):
        name, values = state.get("name", ""), {}
        if not name.isprintable():  # it would rule the terminal that it is printed to
            notes.append(f"left out: state {one_line(name)} of the SRDF, a name with characters that are not printable")
            continue
        for joint in state.iter("joint"):
            values[joint.get("name", "")] = numbers = _numbers(joint.get("value", ""))
            if not numbers or not all(map(math.isfinite, numbers)):
                what = "no number" if not numbers else "not finite"
                found = one_line(f"'{joint.get('value', '')}' of {joint.get('name')} is {what}")
                notes.append(f"left out: state {name} of the SRDF, in which {found}")
                break
        else:
            # Joints of several values, such as floating bases, cannot be planned anyway.
            if all(len(numbers) == 1 for numbers in values.values()):
                states.append((name, {joint: numbers[0] for joint, numbers in values.items()}))
    return states


def _numbers(text: str) -> list[float]:
    """The numbers of an attribute; none where a word is no number."""
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return []
