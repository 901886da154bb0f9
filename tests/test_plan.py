"""The next recording: what it separates, how sure it makes, and that a machine can."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from made import straight

from softnn import Recording, diagnose
from softnn.axes import COMPONENTS, SPECIMEN
from softnn.cli import main
from softnn.contracts import InputError
from softnn.effects import effect
from softnn.fit import Guess, Piece
from softnn.metrics import weights
from softnn.mismatch import plan
from softnn.mismatch.compare import FLOOR, LIKELY, SURE, shares
from softnn.mismatch.plan import Alternative, Alternatives
from softnn.mismatch.programmes import Library, Limits, Programme, corners, recorded
from softnn.model_file import from_dict, to_dict
from softnn.models.units import Units
from softnn.report.phrases import promise

HOOKE = Units("hooke", (0.0, 1.0))
ERROR = 0.01


def stored(*effects, stiffness=1.0, axes=SPECIMEN, history="fresh"):
    """A spring [MPa] with effects, each an id and its values."""
    pieces = tuple(
        Piece(effect(name), effect(name).defaults() | values, ())
        for name, values in effects
    )
    guess = Guess(HOOKE, np.array([stiffness]), pieces)
    return from_dict(to_dict(guess, (), history, False, axes=axes))


def limits_of(*chunks, continued=False, one=1.0):
    names = [f"r{i}" for i in range(len(chunks))]
    stress = [c.strain for c in chunks]
    return recorded(names, chunks, stress, continued, one)


RAMP = straight([0, 0.5], 0.05, 0.1)
LOOP = straight([0, 0.5, 0], 0.05, 0.1)
SOFTENS = ("mullins_softening", {"depth": 0.4, "scale": 0.05})
SETS = ("permanent_set", {"ratio": 0.2})
DRIFTS = ("load_cell_drift", {"drift_MPa_per_s": 1e-3})


def among(*models, known=None, share=None, error=ERROR, folds=None, **more):
    share = share or [1 / len(models)] * len(models)
    folds = np.zeros((len(models), 0)) if folds is None else folds
    sets = [
        Alternative(frozenset(p.effect.id for p in m.pieces), p, error, m, f)
        for m, p, f in zip(models, share, folds, strict=True)
    ]
    known = known or limits_of(RAMP)
    return Alternatives(tuple(sets), known, models[0].axes, 0.0, **more)


def made(levels, rate=0.05, kind="programme"):
    chunk = straight(levels, rate, 0.1)
    return Programme("made", chunk.time_s, chunk.strain, None, kind)


# --- how far predictions lie apart ----------------------------------------------------


def test_distance_is_that_of_least_squares():
    left = among(stored(), stored(DRIFTS))
    programme = made([0, 0.5, 0])
    share = weights(programme.time_s, programme.strain)
    a, b = left.stress(programme)
    mean = (a + b) / 2
    a, b = (y * (share * mean @ mean) / (share * y @ mean) for y in (a, b))
    expected = np.sqrt(share @ (a - b) ** 2 / (share @ mean**2))
    score = left.score(programme)
    assert score.apart[0, 1] == pytest.approx(expected, rel=1e-12)
    # The stress of the drift itself: 1 kPa/s over the programme.
    plain, drifted = score.stress
    time = made([0, 0.5, 0]).time_s
    np.testing.assert_allclose(drifted - plain, 1e-3 * time, atol=1e-12)


def test_a_scale_alone_is_a_specimen_and_no_difference():
    left = among(stored(("slack", {"gap": 0.0})), stored(stiffness=2.0))
    assert left.score(made([0, 0.5, 0])).apart.max() < 1e-12
    found = left.plan()
    assert found is not None
    assert found.programme is None
    assert "any of them serves" in found.to_dict()["why"]


def test_a_second_loading_tells_what_first_loading_cannot():
    left = among(stored(SOFTENS), stored(SETS))
    first, again = left.score(made([0, 0.5])), left.score(made([0, 0.5, 0, 0.5, 0]))
    assert first.apart[0, 1] < ERROR < again.apart[0, 1]
    assert first.gain < again.gain
    found = left.plan()
    assert found.score.gain > first.gain
    # It goes back and forth, which nothing that was recorded does.
    assert (np.diff(found.strain) < 0).any()
    assert found.separates == ["mullins_softening", "permanent_set"]


# --- how sure it makes ----------------------------------------------------------------


def test_no_model_is_nearer_to_the_truth_than_models_are_to_one_another(monkeypatch):
    left = among(stored(SOFTENS), stored(SETS), share=[0.6, 0.4])
    drawn, after = [], Alternatives._after

    def kept(self, place, error, *more):
        drawn.append(error)
        return after(self, place, error, *more)

    monkeypatch.setattr(Alternatives, "_after", kept)
    apart = left.score(made([0, 0.5, 0, 0.5, 0])).apart[0, 1]
    assert apart > 10 * ERROR
    # RMS over pairs drawn by their probabilities, a model beside itself among them.
    assert drawn[-1] == pytest.approx(np.sqrt(ERROR**2 + 0.48 * apart**2))
    left.score(made([0, 0.5]))
    assert drawn[-1] == pytest.approx(ERROR, rel=0.1)
    left.score(made([0, 0.5], kind="blank"))
    assert drawn[-1].max() < ERROR  # a load cell without a specimen obeys no law


def test_the_farther_apart_predictions_lie_the_more_is_settled():
    left = among(stored(SOFTENS), stored(SETS), error=1e-3)
    mild = among(stored(("mullins_softening", {"depth": 0.02})), stored(), error=1e-3)
    programme = made([0, 0.5, 0, 0.5, 0])
    scores = [mild.score(programme), left.score(programme), left.score(programme, 3)]
    assert scores[0].gain < scores[1].gain < scores[2].gain < np.log(2)
    assert scores[0].sure < scores[1].sure < scores[2].sure


def test_predictions_that_agree_settle_nothing():
    left = among(stored(SOFTENS), stored(SETS), share=[0.6, 0.4])
    (after,) = left._after(np.zeros((2, 2)), np.full(2, ERROR), np.zeros(2))
    np.testing.assert_allclose(after, np.broadcast_to([0.6, 0.4], after.shape))
    assert not left.settled(after).any()


@pytest.mark.parametrize("apart", [0.5, 2.0, 8.0])
def test_odds_grow_by_the_logarithm_of_the_error(apart):
    """Beside a Monte Carlo integral of its own: E log odds = K E log(r_j / r_i)."""
    left = among(stored(SOFTENS), stored(SETS))
    place = np.array([[0.0, 0.0], [apart * ERROR, 0.0]])
    (after,) = left._after(place, np.full(2, ERROR), np.full(2, 0.3))
    odds = np.log(after[0, :, 0] / after[0, :, 1])
    rng = np.random.default_rng(5)
    size = ERROR * np.exp(0.3 * rng.standard_normal(200_000))
    parts = rng.standard_normal((200_000, plan.INDEPENDENT)) / plan.INDEPENDENT**0.5
    own = (parts**2).sum(axis=1) * size**2
    other = own + 2 * parts[:, 0] * size * apart * ERROR + (apart * ERROR) ** 2
    own, other = np.sqrt(own) + FLOOR, np.sqrt(other) + FLOOR
    expected = plan.WORTH * np.log(other / own)
    # The mean of 300 draws has a standard error.
    se = expected.std() / plan.DRAWS**0.5
    assert odds.mean() == pytest.approx(expected.mean(), abs=4 * se)


def test_where_prediction_decides_a_recording_is_one_more_fold():
    folds = np.array([[0.02, 0.03, 0.025], [0.03, 0.04, 0.04]])
    left = among(stored(SOFTENS), stored(SETS), folds=folds)
    far = np.array([[0.0, 0.0], [1.0, 0.0]])  # so far that its error hardly counts
    after, fewer = left._after(far, np.full(2, ERROR), np.zeros(2))
    new = np.array([[ERROR], [1.0]])
    expected = shares(np.concatenate([folds, new], axis=1), np.ones(2), 1.0)
    assert after[0].mean(axis=0) == pytest.approx(expected, abs=0.02)
    # Without it the probabilities are as they were, so one recording names nothing.
    assert fewer[0] == pytest.approx(
        np.broadcast_to(shares(folds, np.ones(2), 1.0), fewer[0].shape)
    )
    # On three specimens it is three more folds.
    after, *fewer = left._after(far, np.full(2, ERROR), np.zeros(2), 3)
    expected = shares(np.concatenate([folds, *[new] * 3], axis=1), np.ones(2), 1 / 3)
    assert after[0].mean(axis=0) == pytest.approx(expected, abs=0.02)
    # Without one of these, three recordings are left of four.
    expected = shares(np.concatenate([folds, *[new] * 2], axis=1), np.ones(2), 1 / 2)
    assert fewer[0][0, :, 1].mean() == pytest.approx(expected[1], rel=0.1)


def test_a_name_that_hangs_on_one_new_recording_is_not_promised():
    """Two laws that predicted alike: one recording tells them apart, and may be odd."""
    folds = np.array([[0.025, 0.025, 0.025], [0.02, 0.03, 0.025]])
    known = limits_of(*[RAMP] * 3)
    left = among(stored(SOFTENS), stored(SETS), folds=folds, known=known)
    high, low = np.array([0.95, 0.05]), np.array([0.45, 0.55])
    assert left.settled(high)
    assert left.settled(high, [high])
    assert not left.settled(high, [low])
    assert not left.settled(high, [high, low])


def test_the_promise_of_a_programme_asks_for_names_that_stay():
    """One recording says all, and says it alone: softening is no name without it."""
    folds = np.array([[0.021, 0.031, 0.026], [0.02, 0.03, 0.025]])
    models = stored(SOFTENS), stored(SETS)
    known = limits_of(*[RAMP] * 3)
    left = among(*models, share=[0.49, 0.51], folds=folds, known=known)
    programme = made([0, 0.5, 0, 0.5, 0])
    alone, two = left.score(programme), left.score(programme, 2)
    assert alone.sure < 0.7 < 0.8 < two.sure


def test_what_is_not_likely_to_settle_it_is_not_asked_for():
    """Of one specimen, one more recording makes no name sure by prediction."""
    folds = np.array([[0.001], [0.1]])
    known = limits_of(LOOP, continued=True)
    found = among(stored(SOFTENS), stored(SETS), known=known, folds=folds).plan()
    assert found.score.apart.max() > found.score.error  # predictions lie apart
    assert found.score.sure < LIKELY
    assert found.programme is None
    told = found.to_dict()
    assert "at best" in told["why"]
    assert told["programme"] is told["expected"] is None


def test_one_that_may_settle_it_goes_before_one_that_cannot(monkeypatch):
    """The programme that tells most of all sets settles less than another."""
    scored = Alternatives.score

    def score(self, programme, specimens=1):
        told = scored(self, programme, specimens)
        best = programme.label.startswith("load to") and "hold" in programme.label
        return replace(told, gain=2.0, sure=0.05) if best else replace(told, sure=0.3)

    monkeypatch.setattr(Alternatives, "score", score)
    found = among(stored(SOFTENS), stored(SETS)).plan()
    assert found.programme is not None
    assert found.score.sure == 0.3


def test_more_specimens_are_asked_for_where_one_does_not_settle_it():
    folds = np.array([[0.02, 0.03, 0.025], [0.02, 0.03, 0.025]])
    found = among(stored(SOFTENS), stored(SETS), folds=folds).plan()
    one = found.among.score(found.programme)
    assert 1 < found.specimens <= plan.MOST_SPECIMENS
    assert found.score.sure > one.sure
    likely = among(stored(SOFTENS), stored(SETS), share=[0.87, 0.13], error=1e-4)
    assert likely.plan().specimens == 1


def test_two_recordings_make_no_name_sure():
    folds = np.array([[0.001, 0.001], [0.1, 0.1]])
    programme = made([0, 0.5, 0, 0.5, 0])
    one, two = (
        among(stored(SOFTENS), stored(SETS), known=limits_of(*[RAMP] * n), folds=folds)
        for n in (1, 2)
    )
    assert one.score(programme).sure == 0
    assert two.score(programme).sure > 0.5
    assert one.score(programme, 3).sure > 0.5


def test_larger_errors_of_the_models_or_of_replicates_make_less_sure():
    programme = made([0, 0.5, 0, 0.5, 0])
    models = stored(SOFTENS), stored(SETS)
    small, large = (among(*models, error=e).score(programme) for e in (0.01, 0.3))
    assert small.sure > large.sure
    floor = among(*models, error=0.01, floor=0.3).score(programme)
    assert floor.sure == pytest.approx(large.sure)


def test_a_question_is_settled_at_0_9_or_when_nothing_is_likely():
    left = among(stored(SOFTENS), stored(SOFTENS, SETS), stored())
    low, high = SURE - 0.001, SURE + 0.001
    assert left.open == ["mullins_softening", "permanent_set"]
    assert left.settled(np.array([high, 0.0, 1 - high]))
    assert not left.settled(np.array([low, 0.0, 1 - low]))
    assert left.settled(np.array([0.45, 0.55, 0.0]))  # softening is there
    assert left.settled(np.array([0.0, 1 - high, high]))  # neither is


def test_what_is_sure_already_is_not_asked():
    left = among(stored(SOFTENS), stored(SOFTENS, SETS))
    assert left.open == ["permanent_set"]
    assert not left.settled(np.array([0.6, 0.4]))
    assert left.settled(np.array([0.95, 0.05]))  # no set
    assert left.plan().separates == ["permanent_set"]


def test_one_model_leaves_nothing_to_tell():
    assert among(stored(SOFTENS)).plan() is None
    assert among(stored(SOFTENS), stored(SETS), share=[0.99, 0.01]).plan() is None


# --- programmes -----------------------------------------------------------------------


@pytest.mark.parametrize(
    "given",
    [Limits(), Limits(0.5), Limits(5, 0.2, 0.3), Limits(30, max_rate=0.01)],
)
@pytest.mark.parametrize(
    "chunks", [(LOOP,), (RAMP, straight([0, -0.3, 0.5], 0.1, 0.1))]
)
def test_programmes_stay_within_the_limits(given, chunks):
    known = limits_of(*chunks)
    library = Library(known, given, SPECIMEN)
    found = library.programmes()
    assert len(found) > 3
    strain = given.max_strain or 0.5
    for p in found:
        if p.kind == "programme":  # the others repeat what was recorded
            assert np.abs(p.strain).max() <= strain * (1 + 1e-9), p.label
            rate = np.abs(np.diff(p.strain)) / np.diff(p.time_s)
            most = given.max_rate or known.fast
            assert rate.max() <= most * (1 + 1e-6), p.label
            if not library.back:
                assert p.strain.min() >= 0, p.label
        if given.minutes:
            assert p.seconds <= 60 * given.minutes * (1 + 1e-6), p.label
        assert (np.diff(p.time_s) > 0).all(), p.label
    assert len({p.label for p in found}) == len(found)


@pytest.mark.parametrize(
    "given", [{"minutes": 0}, {"max_rate": -1}, {"max_strain": np.nan}]
)
def test_limits_that_are_no_limits_are_refused(given):
    with pytest.raises(InputError, match="allowed is a number above 0"):
        Limits(**given)


def test_no_time_for_any_programme_is_said():
    left = among(stored(SOFTENS), stored(SETS))
    with pytest.raises(InputError, match="no programme fits into these limits"):
        left.plan(Limits(minutes=0.01))


def test_no_programme_goes_where_a_specimen_tore():
    chunk = straight([0, 0.9], 0.1, 0.05)
    stress = np.where(chunk.strain > 0.5, np.nan, chunk.strain)
    known = recorded(["a"], [chunk], [stress], False)
    assert known.high == pytest.approx(0.5, abs=0.01)
    found = Library(known, Limits(), SPECIMEN).programmes()
    assert max(p.strain.max() for p in found) <= known.high


def test_programmes_have_the_mean_temperature_and_the_extremes():
    chunk = straight([0, 0.5, 0], 0.1, 0.05)
    warm = np.linspace(20, 40, len(chunk.time_s))
    chunk = type(chunk)(chunk.time_s, chunk.strain, warm)
    found = Library(limits_of(chunk), Limits(), SPECIMEN).programmes()
    assert {tuple(np.unique(p.degC[[0, -1]])) for p in found} == {(30.0,), (20.0, 40.0)}
    # At one temperature its stress is only scaled, as that of another specimen.
    left = among(
        stored(("thermal_softening", {"softening_per_C": 0.03})),
        stored(),
        known=limits_of(chunk),
    )
    assert left.score(found[0]).apart.max() < 1e-9
    assert "as the temperature goes from 20 to 40" in left.plan().programme.label


def test_a_component_has_its_own_units():
    axes = COMPONENTS[0]
    known = limits_of(straight([0, 30.0, 0], 2.0, 0.1))
    label = Library(known, Limits(), axes).programmes()[0].label
    assert label == "load to 30 mm and back, twice, at 2 mm/s"


def test_corners_keep_the_path():
    time = np.linspace(0, 10, 2001)
    strain = np.interp(time, [0, 3, 4, 7, 10], [0, 0.5, 0.5, -0.1, 0])
    at, levels = corners(time, strain)
    assert len(at) == 5
    wave = np.sin(time)
    at, levels = corners(time, wave)
    assert np.abs(np.interp(time, at, levels) - wave).max() <= 0.003 * 2


# --- cheap ones -----------------------------------------------------------------------


def test_a_blank_run_shows_what_the_machine_adds_and_no_law():
    left = among(stored(SOFTENS, DRIFTS), stored(SETS), stored())
    blank = made([0, 0.5, 0], kind="blank")
    drifting, *others = left.stress(blank)
    np.testing.assert_allclose(drifting, 1e-3 * blank.time_s, atol=1e-12)
    for stress in others:
        np.testing.assert_allclose(stress, 0.0, atol=1e-12)
    assert left.score(blank).apart[1, 2] == 0


def test_the_best_cheap_one_is_told():
    both = among(stored(DRIFTS), stored(SETS), known=limits_of(LOOP))
    advice = both.plan().to_dict()
    assert advice["cheap"]["kind"] in ("repeat", "twice", "blank")
    assert advice["cheap"]["expected"]["gain"] > 0


@pytest.mark.parametrize("decided", ["prediction", "likelihood"])
def test_a_promise_is_a_number_only_where_it_was_found_to_come_true(decided):
    folds = np.array([[0.02, 0.03, 0.025], [0.02, 0.03, 0.025]])
    folds = folds if decided == "prediction" else None
    found = among(stored(SOFTENS), stored(SETS), folds=folds).plan()
    told = found.to_dict()["expected"]
    said = promise(told["sure"])
    if decided == "prediction":
        assert told["sure"] == found.score.sure
        assert "probability" in said
        assert "settles" in repr(found)
    else:
        assert told["sure"] is None
        assert not any(c.isdigit() for c in said)
        assert "settles" not in repr(found)


# --- recordings that continue one another ---------------------------------------------


def test_the_next_recording_of_one_specimen_begins_where_it_ended():
    known = limits_of(LOOP, continued=True)
    left = among(stored(SOFTENS, history="continued"), stored(), known=known)
    (p,) = [
        p for p in left.allowed().programmes() if p.label.startswith("load to 50 % and")
    ][:1]
    assert p.scored > 0
    softened, _ = left.stress(p)
    assert len(softened) == len(p.strain) - p.scored
    # Softened by the recorded loop: already the first loading of the next is soft.
    virgin = stored(SOFTENS).stress([""], [made([0, 0.5, 0, 0.5, 0]).chunk], [None])[0]
    half = len(virgin) // 2
    strain = p.strain[p.scored :]
    first = slice(1, int(strain.argmax()))
    expected = np.interp(
        strain[first],
        made([0, 0.5]).strain,
        virgin[half : half + len(made([0, 0.5]).strain)],
    )
    np.testing.assert_allclose(softened[first], expected, atol=2e-3)


# --- what is stored and written -------------------------------------------------------


def test_alternatives_read_back_the_same(tmp_path):
    left = among(stored(SOFTENS), stored(SETS), known=limits_of(LOOP), floor=0.02)
    again = Alternatives.from_dict(json.loads(json.dumps(left.to_dict())))
    assert again.plan().to_dict() == left.plan().to_dict()


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("noise",), "x"),
        (("sets", 0, "folds"), [0.1]),
        (("recorded", "count"), 0),
        (("noise",), float("nan")),
        (("sets",), []),
        (("sets",), 5),
        (("sets", 0, "probability"), -1),
        (("sets", 0, "model"), {"kind": "other"}),
        (("recorded", "strain"), [0.0, 0.0]),
        (("recorded", "rate_per_s"), [1.0, float("inf")]),
        (("recorded", "courses", 0, "time_s"), [0.0, 1e300]),
        (("recorded", "courses"), []),
        (("recorded", "interval_s"), 0.0),
    ],
)
def test_alternatives_that_cannot_be_are_refused(place, value):
    given = among(stored(SOFTENS), stored(SETS), known=limits_of(LOOP)).to_dict()
    given = json.loads(json.dumps(given))
    inner = given
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    with pytest.raises(InputError):
        Alternatives.from_dict(given)


def found_folder(folder, left):
    result = {"alternatives": left.to_dict(), "candidates": [], "selected": []}
    folder.mkdir(parents=True)
    (folder / "diagnosis.json").write_text(json.dumps(result))
    return folder


def test_the_command_writes_a_programme_that_a_machine_can_follow(tmp_path, capsys):
    left = among(stored(SOFTENS), stored(SETS), known=limits_of(LOOP))
    found_folder(tmp_path / "out" / "case", left)
    assert (
        main(["plan", str(tmp_path / "out"), "--minutes", "2", "--max-strain", "0.3"])
        == 0
    )
    told = capsys.readouterr().out
    assert "next_recording.csv" in told
    table = pd.read_csv(tmp_path / "out" / "case" / "next_recording.csv")
    assert list(table) == ["time_s", "strain"]
    assert table.strain.max() == pytest.approx(0.3)
    assert table.time_s.iloc[0] == 0
    assert table.time_s.iloc[-1] <= 120 * (1 + 1e-9)


@pytest.mark.parametrize("options", [["--minutes", "-1"], ["--max-rate", "0"]])
def test_the_command_refuses_in_one_line(tmp_path, capsys, options):
    left = among(stored(SOFTENS), stored(SETS), known=limits_of(LOOP))
    folder = found_folder(tmp_path / "case", left)
    assert main(["plan", str(folder), *options]) == 2
    assert main(["plan", str(tmp_path / "nowhere")]) == 2
    (folder / "diagnosis.json").write_text('{"alternatives": null}')
    assert main(["plan", str(folder)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 3
    assert "diagnose again" in lines[2]


def test_too_little_was_recorded_asks_for_every_kind_of_loading():
    left = among(stored(), known=limits_of(RAMP), action="record_unloading")
    found = left.plan()
    strain = found.strain
    turns = np.count_nonzero(np.diff(np.sign(np.diff(strain))) != 0)
    assert turns >= 11  # three levels, each twice, and a hold
    assert found.to_dict()["expected"] is None
    assert "hold" in found.programme.label


def test_a_diagnosis_has_its_next_recording(softened):
    _, out = softened
    result = json.loads((out / "diagnosis.json").read_text())
    left = Alternatives.from_dict(result["alternatives"])
    found = left.plan()
    told = None if found is None else json.loads(json.dumps(found.to_dict()))
    assert result["next_recording"] == told
    assert (out / "next_recording.csv").exists() == bool(told and told["programme"])
    assert "mullins_softening" in left.effects


def test_models_that_are_alike_and_poor_ask_for_what_was_not_recorded():
    models = stored(("slack", {"gap": 0.0})), stored(stiffness=2.0)
    assert among(*models, action="use_corrected_and_record").plan().programme is None
    found = among(*models, action="record").plan()
    assert "each twice" in found.programme.label
    # Nor is there anything to tell where one model is left and the error is poor.
    assert (
        "each twice" in among(stored(SOFTENS), action="record").plan().programme.label
    )


@pytest.mark.parametrize(
    ("minutes", "said"),
    [(None, "each twice"), (2.0, "each twice"), (1.0, "two cycles"), (0.6, "a cycle")],
)
def test_a_programme_of_every_loading_keeps_to_the_time(minutes, said):
    library = Library(limits_of(RAMP), Limits(minutes=minutes), SPECIMEN)
    found = library.covering()
    assert said in found.label
    if minutes:
        assert found.seconds <= 60 * minutes * (1 + 1e-9)
    moves = np.sign(np.diff(found.strain))
    assert {1, -1, 0} <= set(moves)  # it loads, unloads and holds


def test_one_cycle_that_takes_too_long_is_refused():
    library = Library(limits_of(RAMP), Limits(minutes=0.1), SPECIMEN)
    with pytest.raises(InputError, match="no programme fits into these limits"):
        library.covering()


@pytest.mark.slow
def test_a_model_that_runs_away_on_what_was_left_out_stops_no_answer():
    """An approach at exactly zero: in that stretch any stress is a huge share of it."""
    time = np.linspace(0, 40, 200)
    strain = np.interp(time, [0, 20, 40], [0, 0.5, 0])
    share = np.zeros(200)  # of a branch of 5 s, by steps of the strain
    for i in range(1, 200):
        share[i] = share[i - 1] * np.exp(-0.2 / 5) + 0.05 * np.diff(strain)[i - 1]
    loop = np.round(0.6 * strain * (1 - 0.25 * strain) + share, 6)
    before = np.linspace(0, 39.8, 200)
    one = Recording(
        np.concatenate([before, time + 40]),
        np.concatenate([0.15 * before / 40, 0.15 + strain]),
        np.concatenate([0 * before, loop]),
        name="a",
    )
    told = diagnose(one).result["alternatives"]
    assert max(max(a["folds"]) for a in told["sets"]) == plan.BEYOND
    assert Alternatives.from_dict(told).to_dict() == told
