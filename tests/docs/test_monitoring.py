"""The rules and the dashboard in examples/monitoring use metrics that exist, and Prometheus takes them."""

import itertools
import json
import pathlib
import re
import subprocess

import pytest
import yaml

from fleet.health.metrics import fleet_metrics
from fleet.health.rollup import SeenEdge
from fleet.host.edge.metrics import Metrics
from fleet.model.summary import Summary, Trouble

FOLDER = pathlib.Path(__file__).parents[2] / "examples" / "monitoring"
RULES = sorted(FOLDER.glob("*.rules.yaml"))
DASHBOARD = json.loads((FOLDER / "grafana-dashboard.json").read_text())
NAME = re.compile(r"(?<![\w:$])[a-z_][a-z0-9_]*(?::[a-z0-9_]+)*(?:_[a-z0-9]+)*")
SELECTED = re.compile(r"\{[^}]*\}|\[[^\]]*\]|\"[^\"]*\"")
LISTS = re.compile(r"\b(?:by|on|ignoring|without|group_left|group_right)\s*\(([^)]*)\)")
LABEL = re.compile(r"\b([a-z_]+)\s*(?:=~|!~|!=|=)\s*\"")
FUNCTIONS = {
    *("sum", "count", "max", "topk", "sort_desc", "rate", "increase", "histogram_quantile", "time"),
    *("and", "by", "on", "group_left"),
}
OF_PROMETHEUS = {"up": {"job", "instance"}}
ONCE_KNOWN = {"fleet_cloud_broker_round_trip_seconds"}  # an edge that never reached a broker has none
EVERYWHERE = {"job", "instance", "le"}


def rules():
    files = [yaml.safe_load(path.read_text()) for path in RULES]
    return [rule for file in files for group in file["groups"] for rule in group["rules"]]


def panels():
    return [panel for panel in DASHBOARD["panels"] if panel.get("targets")]


EXPRESSIONS = {rule.get("record") or rule["alert"]: rule["expr"] for rule in rules()} | {
    f"{panel['title']} {target['refId']}": target["expr"] for panel in panels() for target in panel["targets"]
}


@pytest.fixture(scope="module")
def known(module_at):
    """Return all metrics with their labels, as an edge and a fleet view serve them."""
    edge = module_at("fleet/host/edge/test_metrics.py").FakeEdge()
    trouble = Trouble("fault", "why", 1.0, 1, "ugv", "can:can0", ("a",))
    seen = [SeenEdge("a", True, 1.0, Summary("a", "1", 1.0, 1.0, troubles=(trouble,)), 1.0)]
    found = {name: set(labels) for name, labels in OF_PROMETHEUS.items()}
    try:
        for family in itertools.chain(Metrics(edge).collect(), fleet_metrics(seen, 1.0)):
            found.setdefault(family.name, set())
            for sample in family.samples:
                found.setdefault(sample.name, set()).update(sample.labels)
            if family.type == "counter":
                found.setdefault(f"{family.name}_total", set()).update(family._labelnames)
    finally:
        edge.bridge.client.close()
    for rule in rules():
        if "record" in rule:
            found[rule["record"]] = labels_in(rule["expr"])
    return found


def names_in(expression):
    bare = LISTS.sub(" ", SELECTED.sub(" ", expression))
    return {name for name in NAME.findall(bare) if name not in FUNCTIONS}


def labels_in(expression):
    listed = {
        label.strip() for match in LISTS.findall(expression) for label in match.split(",") if label.strip()
    }
    return listed | set(LABEL.findall(expression))


@pytest.mark.parametrize("what", EXPRESSIONS)
def test_an_expression_uses_metrics_and_labels_that_there_are(what, known):
    names = names_in(EXPRESSIONS[what])
    assert names, "it reads something"
    assert names <= known.keys()
    labels = set.union(*(known[name] for name in names)) | EVERYWHERE
    assert labels_in(EXPRESSIONS[what]) <= labels


def test_a_name_that_there_is_not_would_be_seen(known):
    assert names_in(
        'sum by (edge) (rate(fleet_edge_robot{edge="a"}[5m])) / level_cause:x:sum'
    ) - known.keys() == {
        "fleet_edge_robot",
        "level_cause:x:sum",
    }


def test_an_alert_tells_only_labels_that_its_expression_leaves_and_what_to_do_next(known):
    alerts = [rule for rule in rules() if "alert" in rule]
    assert len(alerts) >= 10
    for alert in alerts:
        assert alert["labels"]["severity"] in {"critical", "warning", "info"}
        text = alert["annotations"]["summary"] + alert["annotations"]["next"]
        kept = set.union(*(known[name] for name in names_in(alert["expr"])))
        listed = LISTS.search(alert["expr"])
        kept = {label.strip() for label in listed[1].split(",")} if listed else kept | EVERYWHERE
        assert set(re.findall(r"\$labels\.(\w+)", text)) <= kept, alert["alert"]


def test_the_reference_names_metrics_that_there_are_and_all_of_edges(known):
    page = (FOLDER.parents[1] / "docs" / "reference" / "metrics.md").read_text()
    named = set(re.findall(r"`(fleet_\w+)`", page))
    assert named - ONCE_KNOWN <= known.keys()
    assert {name for name in known if name.startswith(("fleet_edge", "fleet_trouble"))} <= named


def test_each_panel_has_a_place_and_a_name_of_its_own():
    places = [tuple(panel["gridPos"][key] for key in "xywh") for panel in DASHBOARD["panels"]]
    assert all(x + w <= 24 for x, _, w, _ in places)
    for (x, y, w, h), (x2, y2, w2, h2) in itertools.combinations(places, 2):
        assert x + w <= x2 or x2 + w2 <= x or y + h <= y2 or y2 + h2 <= y
    assert len({panel["id"] for panel in DASHBOARD["panels"]}) == len(places)


@pytest.mark.parametrize(
    "arguments",
    [
        ("check", "rules", *(path.name for path in RULES)),
        ("test", "rules", "fleet-alerts.test.yaml"),
        ("check", "config", "prometheus.yaml"),
    ],
    ids=" ".join,
)
def test_prometheus_takes_the_rules_and_they_do_what_they_say(program, arguments):
    ran = subprocess.run(
        [program("promtool"), *arguments], cwd=FOLDER, capture_output=True, text=True, check=False, timeout=60
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr


def test_prometheus_takes_each_expression_of_the_dashboard(program, tmp_path):
    expressions = [target["expr"].replace("$edge", ".*") for panel in panels() for target in panel["targets"]]
    made = [
        {"record": f"panel:{number}", "expr": expression} for number, expression in enumerate(expressions)
    ]
    path = tmp_path / "panels.yaml"
    path.write_text(yaml.safe_dump({"groups": [{"name": "panels", "rules": made}]}))
    ran = subprocess.run(
        [program("promtool"), "check", "rules", path], capture_output=True, text=True, check=False, timeout=60
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
