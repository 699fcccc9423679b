"""`records.dataclass` gives what `dataclasses.dataclass` gives; that one is the oracle."""

import copy
import dataclasses
import inspect
import pickle
import subprocess
import sys
import threading
from abc import ABC, abstractmethod
from dataclasses import FrozenInstanceError, asdict, astuple, field, fields, replace
from typing import Any, ClassVar, Generic, TypeVar

import pytest

from optiplan import records

T = TypeVar("T")
STANDARD, OURS = dataclasses.dataclass, records.dataclass


def plain(dataclass: Any, **options: Any) -> type:
    """Every kind of field."""

    @dataclass(**options)
    class Plain:
        """Text."""

        a: int
        b: "float" = 2.0
        c: ClassVar[int] = 7
        d: list[int] = field(default_factory=list)
        e: int = field(default=5, repr=False)
        f: tuple[int, ...] = field(default=(), compare=False)
        g: int = field(init=False, default=3)
        h: dict[str, int] = field(init=False, default_factory=dict)
        k: int = field(default=9, kw_only=True)

        def double(self) -> int:
            return 2 * self.a

    return Plain


def inherited(dataclass: Any, **options: Any) -> type:
    """Fields of bases, one of them told anew, and what is done after."""

    @dataclass(**options)
    class Base(Generic[T]):
        """Text."""

        kind: ClassVar[str]
        other: "ClassVar[int]" = 3
        a: T
        b: int = 1

    class Between(Base[int]):
        """No dataclass."""

    @dataclass(**options)
    class Plain(Between):
        """Text."""

        c: int = 0
        b: int = 4
        seen: list[int] = field(default_factory=list)

        def __post_init__(self) -> None:
            self.seen.append(self.b)

    return Plain


def with_methods(dataclass: Any, **options: Any) -> type:
    """Methods of its own that the decorator leaves alone."""

    @dataclass(**options)
    class Plain:
        """Text."""

        a: int
        b: int = 0

        def __repr__(self) -> str:
            return f"<{self.a}>"

        def __eq__(self, other: object) -> bool:
            return isinstance(other, type(self)) and self.a == other.a

    return Plain


def with_hash(dataclass: Any, **options: Any) -> type:
    """A hash of its own."""

    @dataclass(**options)
    class Plain:
        """Text."""

        a: int
        b: int = 0

        def __hash__(self) -> int:
            return 7

    return Plain


def of_words(dataclass: Any, **options: Any) -> type:
    """All by name, by a base that is abstract."""

    class Base(ABC):
        @abstractmethod
        def area(self) -> float: ...

    @dataclass(kw_only=True, **options)
    class Plain(Base):
        """Text."""

        a: int
        b: int = 0

        def area(self) -> float:
            return 1.0

    return Plain


MAKERS = plain, inherited, with_methods, with_hash, of_words
OPTIONS = (
    {},
    {"frozen": True},
    {"eq": False},
    {"frozen": True, "eq": False},
    {"repr": False},
    {"frozen": True, "eq": False, "repr": False},
)
CALLS: tuple[tuple[tuple[Any, ...], dict[str, Any]], ...] = (
    ((1,), {}),
    ((1, 2), {}),
    ((), {"a": 1}),
    ((), {"b": 1, "a": 2}),
    ((1, 2, [3]), {}),
    ((1,), {"k": 4, "d": [1]}),
    ((1,), {"seen": [2]}),
    ((), {}),
    ((1,), {"a": 2}),
    ((1,), {"zz": 2}),
    ((1,), {"c": 2}),
    ((1,), {"g": 2}),
    ((1, 2, 3, 4, 5, 6, 7, 8, 9), {}),
)


def outcome(call: Any, *args: Any, **kwargs: Any) -> Any:
    """What is returned, or what is raised."""
    try:
        return call(*args, **kwargs)
    except Exception as error:
        return type(error), str(error)


@pytest.mark.parametrize("options", OPTIONS, ids=str)
@pytest.mark.parametrize("maker", MAKERS, ids=lambda maker: maker.__name__)
class TestAsTheStandardOne:
    def test_calls(self, maker: Any, options: dict[str, bool], monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(records, "OFTEN", 10)
        standard, ours = maker(STANDARD, **options), maker(OURS, **options)
        worked = 0
        for args, kwargs in CALLS * records.OFTEN:  # before and after `__init__` is compiled
            expected, found = outcome(standard, *args, **kwargs), outcome(ours, *args, **kwargs)
            if isinstance(expected, tuple):
                assert found == expected
                continue
            worked += 1
            assert asdict(found) == asdict(expected)
            assert vars(found) == vars(expected)
            assert not options.get("repr", True) or repr(found) == repr(expected)
            by_value = isinstance(outcome(hash, expected), tuple) or options.get("eq", True)
            assert not by_value or outcome(hash, found) == outcome(hash, expected)
        assert worked > records.OFTEN

    def test_equality(self, maker: Any, options: dict[str, bool]) -> None:
        standard, ours = maker(STANDARD, **options), maker(OURS, **options)
        for cls in (standard, ours):
            one, twin, other = cls(a=1), cls(a=1), cls(a=2)
            assert (one == twin) == (options.get("eq", True) or maker is with_methods)
            assert one != other
            assert one != 1
        assert standard(a=1) != ours(a=1)

    def test_what_others_ask(self, maker: Any, options: dict[str, bool]) -> None:
        standard, ours = maker(STANDARD, **options), maker(OURS, **options)
        assert inspect.signature(ours) == inspect.signature(standard)
        assert dataclasses.is_dataclass(ours)
        assert [(f.name, f.type, f.init, f.kw_only) for f in fields(ours)] == [
            (f.name, f.type, f.init, f.kw_only) for f in fields(standard)
        ]
        assert ours.__match_args__ == standard.__match_args__
        assert repr(ours.__dataclass_params__) == repr(standard.__dataclass_params__)
        assert {name for name in vars(ours) if name[0] != "_"} == {name for name in vars(standard) if name[0] != "_"}
        one = replace(ours(a=1), b=7)
        assert (one.a, one.b) == (1, 7)
        assert astuple(one) == astuple(replace(standard(a=1), b=7))
        assert inspect.signature(ours.__init__) is not None

    def test_assignment(self, maker: Any, options: dict[str, bool]) -> None:
        for cls in (maker(STANDARD, **options), maker(OURS, **options)):
            one = cls(a=1)
            if options.get("frozen"):
                with pytest.raises(FrozenInstanceError, match="cannot assign to field 'a'"):
                    one.a = 2
                with pytest.raises(FrozenInstanceError, match="cannot delete field 'a'"):
                    del one.a
            else:
                one.a = 2
                assert one.a == 2

    def test_a_standard_class_inherits_it(self, maker: Any, options: dict[str, bool]) -> None:
        frozen = options.get("frozen", False)
        more = STANDARD(frozen=frozen)(type("More", (maker(OURS, **options),), {}))
        assert more(a=1) == more(a=1) != more(a=2)
        with pytest.raises(TypeError, match="cannot inherit"):
            STANDARD(frozen=not frozen)(type("More", (maker(OURS, **options),), {}))


@OURS(frozen=True)
class Kept:
    """Found by pickle."""

    a: int
    b: tuple[int, ...] = ()


class TestUse:
    def test_copies_and_pickles(self) -> None:
        one = Kept(1, (2,))
        assert copy.copy(one) == copy.deepcopy(one) == pickle.loads(pickle.dumps(one)) == one

    def test_a_pickle_is_read_where_no_instance_has_been_made(self) -> None:
        text = (
            "import pickle, sys; from tests.test_records import Kept;"
            f"one = pickle.loads({pickle.dumps(Kept(1, (2,)))!r});"
            "print(one, hash(one) == hash((1, (2,))), one == Kept(1, (2,)))"
        )
        done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
        assert done.stdout.split("\n")[0] == "Kept(a=1, b=(2,)) True True"

    def test_threads_make_the_first_instances_at_once(self) -> None:
        for _ in range(50):
            cls = plain(OURS, frozen=True)
            start, made = threading.Barrier(4), list[Any]()

            def make(cls: type = cls, start: threading.Barrier = start, made: list[Any] = made) -> None:
                start.wait()
                made.append((cls(1), fields(cls), repr(cls(2))))

            threads = [threading.Thread(target=make) for _ in range(4)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            assert len(made) == 4
            assert all(found[1] == made[0][1] and found[2] == made[0][2] for found in made)

    def test_nothing_is_compiled_for_a_class_and_its_first_instance(self, monkeypatch: pytest.MonkeyPatch) -> None:
        compiled: list[str] = []
        standard = dataclasses.dataclass
        monkeypatch.setattr(dataclasses, "dataclass", lambda **said: compiled.append(str(said)) or standard(**said))
        cls = plain(OURS, frozen=True)
        assert cls(1, d=[2]).d == [2]
        assert compiled == []
        repr(cls(1))
        assert len(compiled) == 1

    def test_slots_are_left_to_the_standard_one(self) -> None:
        cls = with_hash(OURS, slots=True)
        assert cls.__slots__ == ("a", "b")
        assert repr(cls(1)).endswith("Plain(a=1, b=0)")

    def test_matched_by_position(self) -> None:
        match Kept(3, (4,)):
            case Kept(a, b):
                assert (a, b) == (3, (4,))

    @pytest.mark.parametrize("dataclass", [STANDARD, OURS])
    def test_an_init_put_in_its_place_stays(self, dataclass: Any) -> None:
        cls: Any = plain(dataclass)
        cls(1)
        standard, calls = cls.__init__, list[int]()

        def counted(self: Any, a: int) -> None:
            calls.append(a)
            standard(self, a)

        cls.__init__ = counted
        made = [cls(a).a for a in range(2 * records.OFTEN)]
        assert calls == made == list(range(2 * records.OFTEN))

    @pytest.mark.parametrize("dataclass", [STANDARD, OURS])
    def test_signature_of_an_instance_that_is_called(self, dataclass: Any) -> None:
        @dataclass(frozen=True)
        class Line:
            """Text."""

            slope: float

            def __call__(self, x: float) -> float:
                return self.slope * x

        assert list(inspect.signature(Line(2.0)).parameters) == ["x"]
        assert list(inspect.signature(Line.__init__).parameters) == ["self", "slope"]
        assert inspect.signature(Line(2.0).__call__).return_annotation is float

    @pytest.mark.parametrize("dataclass", [STANDARD, OURS])
    def test_attributes_of_a_plain_class_that_inherits_a_frozen_one(self, dataclass: Any) -> None:
        base: Any = plain(dataclass, frozen=True)

        class Named(base):  # type: ignore[misc]
            def __init__(self, name: str) -> None:
                super().__init__(1)
                self.name = name

        one = Named("left")
        assert (one.a, one.name) == (1, "left")
        del one.name
        with pytest.raises(FrozenInstanceError, match="cannot assign to field 'a'"):
            one.a = 2
        with pytest.raises(FrozenInstanceError, match="cannot delete field 'a'"):
            del one.a

    def test_replace_is_what_python_calls_from_3_13_on(self) -> None:
        replaced: Any = vars(Kept)["__replace__"]
        assert replaced(Kept(1), a=2) == Kept(2)

    def test_super_calls_what_is_made_later(self) -> None:
        @OURS
        class Base:
            """Text."""

            a: int

        class Sub(Base):
            def __init__(self) -> None:
                super().__init__(5)

            def __repr__(self) -> str:
                return "sub of " + super().__repr__()

        assert repr(Sub()).endswith("Sub(a=5)")
        assert str(inspect.signature(Sub)) in {"()", "() -> None"}
