"""Inputs found by type: exact types first, no stage before what it needs, ambiguity told, cycles written out."""

import graphlib
import itertools
import random

import pytest
from hypothesis import given, strategies as st

from robid_core import Artifact, Configurations, Design, Excitation, Fit, Frf, Record
from robid_core.pipeline.wiring import Open, StageSignature, Wires, cycles, dependents, in_order, wire


def chain(*extra: StageSignature) -> list[StageSignature]:
    return [
        StageSignature("where", Configurations, {}),
        StageSignature("excite", Excitation, {"configurations": Configurations}),
        StageSignature("acquire", Record, {"configurations": Configurations, "excitation": Excitation}),
        StageSignature("frf", Frf, {"record": Record}),
        StageSignature("fit", Fit, {"frf": Frf}),
        StageSignature("choose", Design, {"fit": Fit}),
        *extra,
    ]


def test_an_exact_type_goes_before_a_subclass() -> None:
    wires, left = wire(chain())
    assert not left
    assert wires["excite"] == {"configurations": "where"}
    assert wires["acquire"] == {"configurations": "where", "excitation": "excite"}


def test_a_subclass_serves_where_nothing_is_exact() -> None:
    nodes = [
        StageSignature("choose", Design, {}),
        StageSignature("excite", Excitation, {"configurations": Configurations}),
    ]
    wires, left = wire(nodes)
    assert not left
    assert wires["excite"] == {"configurations": "choose"}


def test_a_source_that_depends_on_the_asker_is_not_meant() -> None:
    """`verify` measures again where `choose` says, which needs the fit: the first FRF cannot mean its record."""
    verify = StageSignature(
        "verify",
        Record,
        {"configurations": Configurations, "excitation": Excitation},
        given={"configurations": "choose", "excitation": "excite"},
    )
    wires, left = wire(chain(verify))
    assert not left
    assert wires["frf"] == {"record": "acquire"}


def test_the_order_of_the_file_does_not_matter() -> None:
    nodes = chain()
    expected, _ = wire(nodes)
    for seed in range(20):
        shuffled = random.Random(seed).sample(nodes, len(nodes))
        wires, left = wire(shuffled)
        assert not left
        assert wires == expected


def test_two_equal_sources_stay_open() -> None:
    again = StageSignature("again", Record, {"configurations": Configurations, "excitation": Excitation})
    _, left = wire(chain(again))
    assert left == [Open("frf", "record", Record, ("acquire", "again"))]


def test_a_missing_source_stays_open_without_candidates() -> None:
    _, left = wire([StageSignature("fit", Fit, {"frf": Frf})])
    assert left == [Open("fit", "frf", Frf, ())]


def test_a_stage_never_feeds_itself() -> None:
    _, left = wire([StageSignature("clean", Record, {"record": Record})])
    assert left == [Open("clean", "record", Record, ())]


def test_what_the_user_wires_is_taken_as_it_is() -> None:
    again = StageSignature("again", Record, {"configurations": Configurations, "excitation": Excitation})
    nodes = [
        StageSignature("frf", Frf, {"record": Record}, given={"record": "again"}) if n.name == "frf" else n
        for n in chain(again)
    ]
    wires, left = wire(nodes)
    assert not left
    assert wires["frf"] == {"record": "again"}


def test_an_optional_input_takes_what_there_is_or_stays_away() -> None:
    page = StageSignature("page", None, {"fit": Fit, "design": Design}, frozenset({"fit", "design"}))
    assert wire([page]) == ({"page": {}}, [])
    assert wire(chain(page))[0]["page"] == {"fit": "fit", "design": "choose"}


def test_an_optional_input_closes_no_cycle() -> None:
    """The fit would like a design as a hint, but the only design is made from it."""
    nodes = [
        StageSignature("fit", Fit, {"frf": Frf, "design": Design}, frozenset({"design"}))
        if n.name == "fit"
        else n
        for n in chain()
    ]
    wires, left = wire(nodes)
    assert not left
    assert wires["fit"] == {"frf": "frf"}
    assert not cycles(wires)


def test_a_required_input_with_one_source_closes_a_cycle_that_is_told() -> None:
    wires, left = wire([node for node in chain() if node.name != "where"])
    assert not left
    assert cycles(wires) == [["excite", "acquire", "frf", "fit", "choose", "excite"]]


def joint(*extra: StageSignature, **of_fit: object) -> list[StageSignature]:
    """Two responses and a fit that takes all there are; records where there are any."""
    fit = StageSignature(
        "fit",
        Fit,
        {"frfs": Frf, "records": Record},
        frozenset({"records"}),
        many=frozenset({"frfs", "records"}),
        **of_fit,  # type: ignore[arg-type]
    )
    return [fit, StageSignature("light", Frf, {}), StageSignature("heavy", Frf, {}), *extra]


def test_an_input_that_takes_many_takes_all_there_are_in_the_order_of_the_file() -> None:
    wires, left = wire(joint())
    assert not left
    assert wires["fit"] == {"frfs": ("light", "heavy")}
    assert in_order(wires) == ["light", "heavy", "fit"]
    wires, left = wire(joint(StageSignature("again", Record, {}), given={"frfs": ("heavy",)}))
    assert wires["fit"] == {"frfs": ("heavy",), "records": ("again",)}


def test_an_input_that_takes_many_leaves_out_what_is_made_from_its_own_stage() -> None:
    verify = StageSignature("verify", Record, {"fit": Fit})
    check = StageSignature("check", Frf, {"record": Record})
    wires, left = wire(joint(verify, check))
    assert not left
    assert wires["fit"] == {"frfs": ("light", "heavy")}
    assert not cycles(wires)


def test_what_needs_many_decides_what_a_single_one_can_mean() -> None:
    """`frf` may take the record of `verify` only if that does not come from the fit that takes `frf`."""
    nodes = joint(
        StageSignature("frf", Frf, {"record": Record}),
        StageSignature("verify", Record, {"fit": Fit}),
        StageSignature("acquire", Record, {}),
    )
    wires, left = wire(nodes)
    assert not left
    assert wires["frf"] == {"record": "acquire"}
    assert wires["fit"] == {"frfs": ("light", "heavy", "frf"), "records": ("acquire",)}


def test_many_that_nobody_makes_stay_open() -> None:
    nodes = joint()[:1]
    assert wire(nodes)[1] == [Open("fit", "frfs", Frf, ())]


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
def test_two_that_could_feed_each_other_take_neither(order: tuple[int, ...]) -> None:
    many = {"records": Record}
    nodes = [
        StageSignature("acquire", Record, {}),
        StageSignature("one", Record, many, many=frozenset(many)),
        StageSignature("other", Record, many, many=frozenset(many)),
    ]
    wires, left = wire([nodes[i] for i in order])
    assert not left
    assert wires["one"] == wires["other"] == {"records": ("acquire",)}


def test_separate_knots_are_told_separately() -> None:
    wires: Wires = {"a": {"x": "b"}, "b": {"x": "a"}, "c": {"x": "d"}, "d": {"x": "c"}, "e": {"x": "a"}}
    assert cycles(wires) == [["a", "b", "a"], ["c", "d", "c"]]


graphs = st.integers(1, 9).flatmap(
    lambda n: st.lists(st.tuples(st.integers(0, n - 1), st.integers(0, n - 1)), max_size=2 * n).map(
        lambda edges: {
            f"s{i}": {f"p{k}": f"s{source}" for k, (taker, source) in enumerate(edges) if taker == i}
            for i in range(n)
        }
    )
)


@given(graphs)
def test_cycles_are_found_exactly_where_graphlib_finds_one(wires: Wires) -> None:
    sorter = graphlib.TopologicalSorter({name: set(sources.values()) for name, sources in wires.items()})
    try:
        sorter.prepare()
        acyclic = True
    except graphlib.CycleError:
        acyclic = False
    found = cycles(wires)
    assert acyclic == (not found)
    for cycle in found:
        assert cycle[0] == cycle[-1]
        assert len(set(cycle)) == len(cycle) - 1
        for source, taker in itertools.pairwise(cycle):
            assert source in wires[taker].values()


@given(graphs)
def test_every_order_is_an_order(wires: Wires) -> None:
    if cycles(wires):
        return
    order = in_order(wires)
    assert sorted(order) == sorted(wires)
    for taker, sources in wires.items():
        for source in sources.values():
            assert order.index(source) < order.index(taker)


def test_ties_run_as_they_are_written() -> None:
    wires: Wires = {"c": {}, "late": {"x": "a"}, "b": {}, "a": {}}
    assert in_order(wires) == ["c", "b", "a", "late"]


@given(graphs, st.integers(0, 8))
def test_dependents_are_what_can_be_reached(wires: Wires, start: int) -> None:
    name = f"s{start % len(wires)}"
    reach = {taker for taker, sources in wires.items() if name in sources.values()}
    while True:
        more = {t for t, sources in wires.items() if reach & set(sources.values())} - reach
        if not more:
            break
        reach |= more
    assert dependents(name, wires) == reach


@pytest.mark.parametrize("n", [256])
def test_the_largest_pipeline_is_wired(n: int) -> None:
    """256 stages that could all feed one another: told as ambiguous, without recursion and in polynomial work."""
    nodes = [StageSignature(f"s{i}", Record, {"record": Record}) for i in range(n)]
    _, left = wire(nodes)
    assert len(left) == n
    long: Wires = {f"s{i}": {"x": f"s{(i + 1) % n}"} for i in range(n)}
    (cycle,) = cycles(long)
    assert len(cycle) == n + 1


def test_a_base_type_takes_anything() -> None:
    wires, _ = wire([StageSignature("any", None, {"x": Artifact}), StageSignature("frf", Frf, {})])
    assert wires["any"] == {"x": "frf"}
