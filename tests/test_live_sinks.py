"""What sinks say of the pose on a plan, and how they draw it."""

import numpy as np
import pytest
from in_memory import Taken

import lineament as ln
from lineament.live import FoxgloveSink, LiveConfig, RosSink
from lineament.live.counters import Counts, Report
from lineament.live.pipeline import Frame
from lineament.live.plan_topics import statuses
from lineament.mapping import VERDICTS, LineMap
from lineament.mapping.evidence import Evidence
from lineament.mapping.following import Whereabouts
from lineament.output.foxglove import FoxgloveMessages
from lineament.output.ros_messages import RosMessages

REPORT, TIME = Report(1.0, Counts(scans=1), Counts(), (0, 0), 0, {}, 0), (1, 2)
WALLS = [((0.0, 0.0), (4.0, 0.0)), ((4.0, 0.0), (4.0, 3.0))]


def recorded(messages, name):
    """Let a maker of messages keep what it is given for those of one name."""
    make, given = getattr(messages, name), []

    def keep(*arguments, **named):
        given.append((*arguments, named))
        return make(*arguments, **named)

    setattr(messages, name, keep)
    return given


@pytest.fixture
def plan(tmp_path):
    LineMap.from_lines(np.array(WALLS)).write(tmp_path / "plan.dxf")
    return str(tmp_path / "plan.dxf")


@pytest.mark.parametrize(
    ("verdict", "turn", "level"),
    [(name, 1e-4, level) for name, level in zip(VERDICTS, (0, 2, 1, 2), strict=True)]
    + [(VERDICTS[2], 1.0, 2), (VERDICTS[0], 2.0, 0)],
)
def test_diagnosis_of_a_pose(verdict, turn, level):
    """0 where it is located, 1 where it is but for a direction, 2 where it is not known."""
    messages = RosMessages("cdr")
    given = recorded(messages, "diagnostics")
    config = LiveConfig(map="a.dxf", log="a.npz")
    sink = RosSink(Taken(), messages, config)
    evidence = Evidence(12.34, 0.75, 0.2, 0.05, 100)
    where = Whereabouts(verdict, (1.0, -2.0, 0.5), np.diag((4e-4, 9e-4, turn)), evidence)
    sink._plan._frame = frame = Frame(ln.LaserScan([2.0], 0.0, 0.1), *[None] * 5, where)
    sink._plan._statuses = statuses(frame, config)
    sink.diagnose(REPORT, TIME)
    (*_, of_node), (topic, moment, told) = given
    assert of_node["level"] == REPORT.level
    assert (topic, moment) == ("/diagnostics", (*TIME, "", ""))
    assert (told["name"], told["hardware_id"]) == ("lineament: /scan/pose", "/scan")
    assert (told["level"], told["summary"]) == (level, verdict)
    deviation = np.degrees(np.sqrt(turn))
    assert told["values"] == {
        "x [m]": "1.000 ± 0.020",
        "y [m]": "-2.000 ± 0.030",
        "theta [°]": f"28.65 ± {deviation:.2f}",
        "explained [%]": "75.0",
        "contradicted [%]": "5.0",
        "log odds": "12.3",
    }


def test_a_log_on_a_plan_has_one_writer_of_transforms(plan, monkeypatch):
    opened, taken = [], Taken()
    monkeypatch.setattr(taken, "_open", lambda topic, _: opened.append(topic) or topic)
    RosSink(taken, RosMessages("cdr"), LiveConfig(log="a.log", map=plan))
    assert "/tf" in opened
    assert len(opened) == len({*opened})


def test_foxglove_draws_the_plan_in_grey(plan):
    messages = FoxgloveMessages()
    given = recorded(messages, "features")
    FoxgloveSink(Taken(), messages, LiveConfig(map=plan)).diagnose(REPORT, TIME)
    ((topic, moment, (layer,), _),) = given
    assert (topic, moment) == ("/scan/plan", (*TIME, "map", ""))
    assert (layer.name, layer.color, layer.size) == ("plan", (0.5, 0.5, 0.5, 1.0), 0.02)
    assert sorted(np.reshape(layer.strips, (-1, 4)).tolist()) == sorted(
        [*a, *b] for a, b in LineMap.read(plan).ends.tolist()
    )
