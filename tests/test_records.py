"""Our dataclasses mean what those of the standard library mean, and take a part of the time to make."""

import copy
import dataclasses
import pickle
from dataclasses import field
from typing import ClassVar

import pytest

from lacmesh import records

SOURCE = """
@dataclass({options})
class Base:
    '''A base.'''
    a: int
    b: float = 1.0

@dataclass({options})
class Record(Base):
    '''A record.'''
    known: ClassVar[int] = 3
    c: list = field(default_factory=list)
    d: int = field(default=0, repr=False)
    e: int = field(default=0, compare=False)

    @property
    def double(self):
        return 2 * self.a
"""
OPTIONS = (
    "", "frozen=True", "frozen=True, eq=False", "frozen=True, repr=False", "frozen=True, kw_only=True", "eq=False",
    "frozen=True, eq=False, repr=False",
)  # fmt: skip


def made(dataclass, options):
    """Class `Record` of the source above, made by a decorator."""
    names = {"dataclass": dataclass, "field": field, "ClassVar": ClassVar, "__name__": __name__}
    exec(SOURCE.format(options=options), names)
    return names["Record"]


def outcome(ask):
    """Answer to a question, or the type and the words of its error."""
    try:
        return ask()
    except Exception as error:
        return type(error), str(error)


@pytest.mark.parametrize("options", OPTIONS)
def test_a_record_answers_as_one_of_the_standard_library(options):
    def answers(dataclass):
        record = made(dataclass, options)
        one, same, other = record(a=1), record(a=1, e=5), record(a=2, d=7)
        yield [f.name for f in dataclasses.fields(record)]
        yield "" if "repr=False" in options else repr(one)
        yield one == same, one == other, one == one, one == 1
        yield outcome(lambda: hash(one) == hash(same))
        yield outcome(lambda: hash(record(a=1, c=())) == hash(record(a=1, c=(), e=4)))
        yield dataclasses.asdict(dataclasses.replace(one, b=4.0)), one.double, record.known
        yield outcome(lambda: record(1, 2.0).b)
        yield outcome(lambda: record())
        for name in ("a", "c", "other"):
            yield outcome(lambda name=name: setattr(one, name, 3))
            yield outcome(lambda name=name: delattr(one, name))
        yield dataclasses.asdict(one) if "frozen" in options else sorted(vars(one))
        yield vars(copy.copy(other)), vars(copy.deepcopy(other))

    assert list(answers(records.dataclass)) == list(answers(dataclasses.dataclass))


@records.dataclass(frozen=True)
class Kept:
    a: int
    b: tuple = ()


def test_a_frozen_record_is_pickled():
    assert pickle.loads(pickle.dumps(Kept(1, (2,)))) == Kept(1, (2,))


def test_methods_of_the_class_stay():
    @records.dataclass(frozen=True)
    class Own:
        a: int

        def __repr__(self):
            return "own"

        def __eq__(self, other):
            return True

        def __hash__(self):
            return 7

    assert (repr(Own(1)), Own(1) == 3, hash(Own(1))) == ("own", True, 7)
