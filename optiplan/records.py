"""Dataclasses that cost their process next to nothing until they are used.

`dataclasses.dataclass` compiles six methods of a class where it stands, half a millisecond a class: a tenth of the time
from the shell to a first plan. The decorator of this module gives classes that are used as those are. Their first
instances are made by a closure, which hands a call that does not fit to the standard `__init__`, for the error. All
else is made by the standard decorator where it is first looked up, also an `__init__` that is looked up in a class.
"""

import dataclasses
import inspect
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass  # for checkers of types the two are one
else:

    def dataclass(cls: type | None = None, /, **options: bool) -> Any:
        """As `dataclasses.dataclass`; with `slots`, which need another class, that one itself."""
        if options.get("slots"):
            return dataclasses.dataclass(cls, **options)
        return (lambda given: _Recipe(given, options).cls) if cls is None else _Recipe(cls, options).cls


_OPTIONS = {"__init__": "init", "__repr__": "repr", "__eq__": "eq", "__hash__": "eq"}
"""Methods, and the options that ask for them."""

_ASKED = "__dataclass_fields__", "__dataclass_params__", "__match_args__"
"""What others ask a class for."""

_NONE = dataclasses.MISSING

OFTEN = 200
"""Instances after which the standard `__init__` is compiled: it takes half a microsecond for each value."""

_MAKING = threading.RLock()


class _Recipe:
    """How the attributes of a class are made; until then it holds a `_Later` for each."""

    def __init__(self, cls: type, options: dict[str, bool]) -> None:
        self.cls, self.options = cls, options
        self.kinds = inspect.get_annotations(cls)
        self.given = {name: cls.__dict__[name] for name in self.kinds if name in cls.__dict__}
        for name, value in self.given.items():  # a class holds defaults, and no fields
            if isinstance(value, dataclasses.Field):
                if value.default is _NONE:
                    delattr(cls, name)
                else:
                    setattr(cls, name, value.default)
        methods = [name for name, option in _OPTIONS.items() if options.get(option, True) and name not in cls.__dict__]
        if options.get("eq", True) and not cls.__dict__.get("__hash__"):  # None where `__eq__` is the class's own
            methods = [name for name in methods if name != "__hash__"] + ["__hash__"] * options.get("frozen", False)
            setattr(cls, "__hash__", None)  # noqa: B010  (of any class)
        if options.get("frozen"):
            _freeze(cls)
        if "__replace__" not in cls.__dict__:  # of `copy.replace`, from Python 3.13 on
            setattr(cls, "__replace__", dataclasses.replace)  # noqa: B010
        for name in (*methods, *_ASKED):
            setattr(cls, name, _Later(self, name))

    def make(self, name: str, later: "_Later") -> Any:
        """An attribute of the class, made unless it is already, or another one was put in the place of `later`."""
        with _MAKING:
            if self.cls.__dict__.get(name) is later:
                setattr(self.cls, name, self.made(name))
            return self.cls.__dict__[name]

    def initialiser(self, later: "_Later") -> Callable[..., None]:
        """The `__init__` of the first instances."""
        with _MAKING:
            if later.first is None:
                later.first = self._initialiser(later)
            return later.first

    def made(self, name: str) -> Any:
        """An attribute by the standard decorator, which makes no other one; of a frozen class `__init__` differs."""
        whole = name == "__dataclass_params__"
        wanted = {option: whole and self.options.get(option, True) for option in _OPTIONS.values()}
        if name in _OPTIONS:
            wanted[_OPTIONS[name]] = True
        frozen = self.options.get("frozen", False) and (whole or name in ("__init__", "__hash__"))
        return dataclasses.dataclass(**(self.options | wanted | {"frozen": frozen}))(self._twin()).__dict__[name]

    def _twin(self) -> type:
        """A class with all the fields of this one that inherits nothing."""
        kinds, values = self._attributes()
        content = {name: value for name, value in values.items() if value is not _NONE}
        if hasattr(self.cls, "__post_init__"):
            content["__post_init__"] = None  # an instance has that of its class
        names = {"__qualname__": self.cls.__qualname__, "__module__": self.cls.__module__, "__doc__": self.cls.__name__}
        return type(self.cls.__name__, (), content | names | {"__annotations__": kinds})

    def _attributes(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Annotations, and fields, defaults or `_NONE`, by name; the fields of the bases first."""
        kinds: dict[str, Any] = {}
        values: dict[str, Any] = {}
        for base in self.cls.__mro__[-2:0:-1]:
            for field in getattr(base, "__dataclass_fields__", {}).values():
                kinds[field.name], values[field.name] = field.type, field
        for name, kind in self.kinds.items():
            kinds[name], values[name] = kind, self.given.get(name, getattr(self.cls, name, _NONE))
        return kinds, values

    def _initialiser(self, later: "_Later") -> Callable[..., None]:
        """An `__init__` that nobody has to compile."""
        kinds, values = self._attributes()
        if any(kind is dataclasses.KW_ONLY or isinstance(kind, dataclasses.InitVar) for kind in kinds.values()):
            return self.made("__init__")  # type: ignore[no-any-return]
        given_by = _Arguments(kinds, values, self.options.get("kw_only", False))
        order, in_order, defaults, factories = given_by.order, given_by.in_order, given_by.defaults, given_by.factories
        known, needed = given_by.known, given_by.known - defaults.keys() - factories.keys()
        put = object.__setattr__ if self.options.get("frozen") else setattr
        after, recipe = hasattr(self.cls, "__post_init__"), self
        made = 0

        def __init__(self: Any, /, *args: Any, **kwargs: Any) -> None:
            nonlocal made
            made += 1
            if made == OFTEN:
                recipe.make("__init__", later)
            given = dict(zip(in_order, args, strict=False))
            twice = not given.keys().isdisjoint(kwargs)
            given |= kwargs
            if twice or len(args) > len(in_order) or not needed <= given.keys() <= known:
                recipe.made("__init__")(self, *args, **kwargs)  # which names what is wrong
                return
            values = defaults | given
            for name, make in factories.items():
                if name not in values:
                    values[name] = make()
            for name in order:
                put(self, name, values[name])
            if after:
                self.__post_init__()

        __init__.__qualname__ = f"{self.cls.__qualname__}.__init__"
        return __init__


class _Arguments:
    """Arguments of an `__init__`, all (`known`) and `in_order`; their defaults; the `order` of the fields."""

    def __init__(self, kinds: dict[str, Any], values: dict[str, Any], named: bool) -> None:
        self.order, self.in_order, self.known = list[str](), list[str](), set[str]()
        self.defaults, self.factories = dict[str, Any](), dict[str, Callable[[], Any]]()
        for name, value in values.items():
            if _of_class(kinds[name]):
                continue
            if isinstance(value, dataclasses.Field):
                self._take(name, value, named if value.kw_only is _NONE else value.kw_only)
            else:
                self._ask(name, value, named)

    def _take(self, name: str, field: "dataclasses.Field[Any]", named: bool) -> None:
        if field.default_factory is not _NONE:
            self.factories[name] = field.default_factory
        if field.init:
            self._ask(name, field.default, named)
        elif name in self.factories:
            self.order.append(name)  # without one its value is that of the class

    def _ask(self, name: str, default: Any, named: bool) -> None:
        self.order.append(name)
        self.known.add(name)
        if default is not _NONE:
            self.defaults[name] = default
        if not named:
            self.in_order.append(name)


class _Later:
    """Stands for an attribute of a class until somebody looks it up; for `__init__`, until somebody does in the class.

    `inspect.signature` binds it to the class itself, from Python 3.13 on.

    Attributes:
        first: the `__init__` of the first instances.
    """

    def __init__(self, recipe: _Recipe, name: str) -> None:
        self._recipe, self._name = recipe, name
        self.first: Callable[..., None] | None = None

    def __get__(self, instance: Any, owner: type) -> Any:
        if self._name == "__init__" and isinstance(instance, self._recipe.cls):
            return (self.first or self._recipe.initialiser(self)).__get__(instance, owner)
        made = self._recipe.make(self._name, self)
        return made.__get__(instance, owner) if self._name in _OPTIONS else made


def _of_class(kind: Any) -> bool:
    """Whether an annotation is of a class variable."""
    if isinstance(kind, str):
        return "ClassVar" in kind
    return kind is ClassVar or getattr(kind, "__origin__", None) is ClassVar


def _freeze(cls: Any) -> None:
    """Let a class refuse assignments to its instances; instances of classes that inherit it, those to its fields."""

    def refuses(instance: Any, name: str) -> bool:
        return type(instance) is cls or any(field.name == name for field in dataclasses.fields(cls))

    def __setattr__(self: Any, name: str, value: Any) -> None:
        if refuses(self, name):
            raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
        super(cls, self).__setattr__(name, value)

    def __delattr__(self: Any, name: str) -> None:
        if refuses(self, name):
            raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
        super(cls, self).__delattr__(name)

    cls.__setattr__, cls.__delattr__ = __setattr__, __delattr__
