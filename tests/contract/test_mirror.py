"""Each module of fleet/ with logic has its tests at the same path below tests/."""

import ast

ELSEWHERE = {
    "__main__.py": "fleet/cli/test_interrupt.py",
    "bridge/command_replies.py": "fleet/bridge/test_downlink.py",
    "bridge/edge_publisher.py": "fleet/bridge/test_bridge.py",
    "bridge/outbound_channel.py": "fleet/bridge/test_uplink.py",
    "bridge/relay.py": "fleet/bridge/test_bridge.py",
    "bridge/retained_stops.py": "fleet/bridge/test_downlink.py",
    "camera/camera.py": "fleet/camera/test_picture.py",
    "camera/v4l2.py": "fleet/camera/test_picture.py",
    "cli/adapters_reload.py": "fleet/host/workers/test_reload.py",
    "cli/changes.py": "fleet/host/edge/test_changes.py",
    "cli/command_text.py": "fleet/cli/test_adapters.py",
    "client/edges.py": "fleet/cli/test_drop_ins.py",
    "client/fleet_metrics.py": "fleet/cli/test_top.py",
    "client/fleet_watch.py": "fleet/cli/test_top.py",
    "client/missions.py": "fleet/client/test_fleet.py",
    "cli/live.py": "fleet/cli/test_serve.py",
    "cli/options.py": "fleet/cli/test_demo.py",
    "cli/outline.py": "fleet/cli/test_stop.py",
    "cli/parameters.py": "fleet/cli/test_params.py",
    "cli/release.py": "fleet/cli/test_stop.py",
    "cli/robot_queries.py": "fleet/cli/test_calibrate.py",
    "cli/run.py": "fleet/cli/test_serve.py",
    "cli/run_edge.py": "fleet/cli/test_serve.py",
    "cli/runs.py": "fleet/cli/test_mission.py",
    "cli/schedule.py": "fleet/host/edge/test_schedules.py",
    "cli/times.py": "fleet/cli/test_history.py",
    "cloud/endpoint.py": "fleet/cloud/test_dial.py",
    "cloud/fallback_reader.py": "fleet/bridge/test_bridge.py",
    "cloud/fields.py": "fleet/cloud/test_outbound_queue.py",
    "cloud/inflight_window.py": "fleet/cloud/test_mqtt_session.py",
    "cloud/reasons.py": "fleet/cloud/test_client.py",
    "cloud/subscriptions.py": "fleet/cloud/test_mqtt_session.py",
    "config/other_edges.py": "fleet/config/test_pair.py",
    "config/certificates.py": "fleet/bus/test_access.py",
    "config/checks.py": "fleet/config/test_load.py",
    "config/drop_in.py": "fleet/config/test_load.py",
    "config/endpoints.py": "fleet/config/test_schema.py",
    "config/environment.py": "fleet/config/test_load.py",
    "config/explain.py": "fleet/config/test_load.py",
    "config/groups.py": "fleet/config/test_load.py",
    "config/masking.py": "fleet/cli/test_support.py",
    "config/nodes.py": "fleet/config/test_yaml.py",
    "config/notify.py": "fleet/host/edge/test_notifier.py",
    "config/text.py": "fleet/config/test_schema.py",
    "config/variables.py": "fleet/config/test_yaml.py",
    "errors.py": "fleet/bridge/test_downlink.py",
    "health/metrics.py": "fleet/cli/test_top.py",
    "history/reader.py": "fleet/history/test_store.py",
    "history/record.py": "fleet/history/test_store.py",
    "host/edge/certificate_expiry.py": "fleet/cli/test_certs.py",
    "host/edge/standby.py": "system/test_standby.py",
    "host/edge/coordinators.py": "fleet/host/edge/test_partners.py",
    "host/edge/cloud_presence.py": "fleet/host/test_two_edges.py",
    "host/edge/metrics_port.py": "fleet/host/test_two_edges.py",
    "host/edge/mission_robots.py": "fleet/missions/test_runs.py",
    "host/edge/mission_queries.py": "fleet/missions/test_runs.py",
    "host/edge/run_reporter.py": "fleet/missions/test_runs.py",
    "host/edge/missions.py": "fleet/missions/test_runs.py",
    "host/edge/webhook.py": "fleet/host/edge/test_notifier.py",
    "host/robot/whereabouts.py": "fleet/host/follow/test_robot_follower.py",
    "host/follow/goal_follower.py": "fleet/host/robot/test_navigator.py",
    "host/follow/leg_follower.py": "adapters/fleet_quadruped/test_navigation.py",
    "host/follow/stuck.py": "adapters/fleet_quadruped/test_navigation.py",
    "host/journal/execution_journal.py": "fleet/host/journal/test_journal.py",
    "host/journal/unwritten_mark.py": "fleet/host/journal/test_journal_file.py",
    "host/logs/folders.py": "fleet/cli/test_logs.py",
    "host/logs/line_format.py": "fleet/host/logs/test_rotating_file.py",
    "host/logs/setup.py": "fleet/host/logs/test_flood_filter.py",
    "host/process/history_service.py": "fleet/host/test_two_edges.py",
    "host/requests/last_command.py": "fleet/host/robot/test_controller.py",
    "host/edge/bridge_to_cloud.py": "fleet/host/edge/test_edge.py",
    "host/edge/changes_elsewhere.py": "fleet/host/workers/test_holding.py",
    "host/edge/robot_reports.py": "fleet/host/edge/test_run_results.py",
    "host/edge/renamed.py": "fleet/host/edge/test_changes.py",
    "host/edge/worker_robots.py": "fleet/host/workers/test_worker_manager.py",
    "host/process/twin_holders.py": "fleet/host/test_two_edges.py",
    "host/process/rebuild.py": "fleet/host/edge/test_changes.py",
    "host/process/robot_runs.py": "fleet/host/process/test_robot_process.py",
    "host/robot/rest.py": "fleet/host/workers/test_reload.py",
    "host/workers/worker_changes.py": "fleet/host/edge/test_changes.py",
    "host/robot/attached_adapter.py": "fleet/host/robot/test_controller.py",
    "host/robot/goal_requests.py": "fleet/host/robot/test_controller.py",
    "host/robot/robot_motion.py": "fleet/host/robot/test_controller.py",
    "host/robot/setpoint_requests.py": "fleet/host/robot/test_controller.py",
    "host/robot/dry_run.py": "fleet/host/robot/test_local_robot.py",
    "host/robot/frame_commands.py": "fleet/host/robot/test_frame_adapter_runner.py",
    "host/robot/own_commands.py": "fleet/host/robot/test_controller.py",
    "host/robot/request_intake.py": "fleet/host/process/test_robot_process.py",
    "host/robot/run_commands.py": "fleet/host/robot/test_controller.py",
    "host/robot/standstill.py": "fleet/host/test_invariants.py",
    "host/runtime/blocking_calls.py": "fleet/host/robot/test_robot_handle.py",
    "host/runtime/loop_monitor.py": "fleet/host/runtime/test_watchdog.py",
    "host/workers/drop_in_inspector.py": "fleet/cli/test_drop_ins.py",
    "host/workers/worker_process.py": "fleet/host/workers/test_worker_manager.py",
    "host/workers/worker_task.py": "fleet/host/workers/test_worker_manager.py",
    "replay/played_edge.py": "fleet/replay/test_player.py",
    "replay/recorded_links.py": "fleet/replay/test_through.py",
    "replay/recorded_robot.py": "fleet/replay/test_through.py",
    "replay/replayed_robot.py": "fleet/replay/test_through.py",
    "record/reading.py": "fleet/replay/test_player.py",
    "link/canbus/frame.py": "fleet/link/canbus/test_raw.py",
    "link/resolve.py": "fleet/link/test_tcp.py",
    "link/stream.py": "fleet/link/test_latest_motion.py",
    "config/known.py": "fleet/config/test_missions.py",
    "rehearsal/common_start.py": "fleet/rehearsal/test_rehearsal.py",
    "missions/inner.py": "fleet/missions/test_steps.py",
    "missions/losses.py": "fleet/missions/test_steps.py",
    "missions/observed.py": "fleet/missions/test_run.py",
    "missions/short_forms.py": "fleet/config/test_missions.py",
    "missions/together.py": "fleet/missions/test_run.py",
    "missions/words.py": "fleet/cli/test_mission.py",
    "model/start.py": "fleet/cli/test_together.py",
    "missions/pausing.py": "fleet/missions/test_engine_life.py",
    "missions/ending.py": "fleet/missions/test_engine_life.py",
    "missions/engine.py": "fleet/missions/test_engine_life.py",
    "missions/facts.py": "fleet/missions/test_engine_life.py",
    "missions/messages.py": "fleet/missions/test_runs.py",
    "missions/model.py": "fleet/missions/test_roles.py",
    "missions/program.py": "fleet/missions/test_store.py",
    "missions/report.py": "fleet/missions/test_runs.py",
    "missions/run_robots.py": "fleet/missions/test_runs.py",
    "missions/state.py": "fleet/missions/test_runs.py",
    "model/report.py": "fleet/bridge/test_bridge.py",
    "plugins/drop_in_file.py": "fleet/plugins/test_probe.py",
    "robot_config.py": "fleet/config/test_schema.py",
    "runtime/event_loop.py": "fleet/host/logs/test_rotating_file.py",
    "schedules/model.py": "fleet/schedules/test_runner.py",
    "sim/broker/conversation.py": "fleet/sim/broker/test_connection.py",
    "sim/broker/directory.py": "fleet/sim/broker/test_connection.py",
    "sim/broker/hub.py": "fleet/sim/broker/test_connection.py",
    "sim/broker/server.py": "fleet/sim/broker/test_connection.py",
    "sim/broker/session.py": "fleet/sim/broker/test_connection.py",
    "sim/process.py": "fleet/sim/test_server.py",
    "spool/contents.py": "fleet/spool/test_queue.py",
    "spool/disk_exchange.py": "fleet/spool/test_queue_disk.py",
    "spool/disk.py": "fleet/spool/test_spool.py",
    "spool/held_topics.py": "fleet/spool/test_queue_disk.py",
    "spool/inspection.py": "fleet/runtime/test_state_format.py",
    "spool/losses.py": "fleet/spool/test_queue.py",
    "spool/memory_buffer.py": "fleet/spool/test_queue.py",
    "spool/statistics.py": "fleet/spool/test_queue.py",
    "spool/store.py": "fleet/spool/test_spool.py",
    "spool/topic_queue.py": "fleet/spool/test_queue.py",
    "spool/topic_queues.py": "fleet/spool/test_queue_disk.py",
    "supervisor/client.py": "fleet/supervisor/test_supervisor.py",
    "supervisor/notices.py": "fleet/supervisor/test_supervisor.py",
    "supervisor/stop_request.py": "fleet/supervisor/test_supervisor.py",
    "testing/bench.py": "fleet/testing/test_planted_bugs.py",
    "testing/motion.py": "fleet/testing/test_contract.py",
    "testing/probes.py": "fleet/testing/test_contract.py",
    "video/peer.py": "fleet/video/test_sender.py",
    "video/track.py": "fleet/video/test_sender.py",
    "wire/encoding.py": "fleet/wire/test_arrays.py",
    "wire/envelope.py": "fleet/wire/test_commands.py",
    "wire/measures.py": "fleet/wire/test_navigation.py",
    "wire/rotation.py": "fleet/wire/test_navigation.py",
    "wire/samples.py": "fleet/wire/test_databus.py",
    "wire/states.py": "fleet/wire/test_arrays.py",
    "wire/velocity.py": "fleet/wire/test_commands.py",
    "yaml_model.py": "fleet/config/test_schema.py",
}
"""Modules with logic whose tests stand elsewhere, with where. To be made shorter, never longer."""
LOGIC = (ast.If, ast.IfExp, ast.For, ast.AsyncFor, ast.While, ast.Try, ast.Match)


def has_logic(path):
    """Return whether a module has a function that decides or repeats something."""
    functions = [
        node
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    ]
    return any(isinstance(node, LOGIC) for function in functions for node in ast.walk(function))


def untested(root):
    """Return the modules without tests at the same path."""
    for path in sorted((root / "fleet").rglob("*.py")):
        name = path.relative_to(root)
        tests = root / "tests" / name.with_name(f"test_{path.name}")
        if path.name != "__init__.py" and has_logic(path) and not tests.exists():
            yield name.relative_to("fleet").as_posix()


def test_every_module_with_logic_has_its_tests_at_the_same_path(root):
    assert sorted(set(untested(root)) - ELSEWHERE.keys()) == []


def test_no_module_is_excused_that_has_its_tests_or_is_gone(root):
    assert sorted(ELSEWHERE.keys() - set(untested(root))) == []


def test_the_tests_that_stand_elsewhere_are_there(root):
    for module, tests in ELSEWHERE.items():
        assert (root / "tests" / tests).exists(), f"{module}: {tests}"
