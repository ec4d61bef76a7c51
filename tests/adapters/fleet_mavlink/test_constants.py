"""What is written here by hand is what pymavlink's dialect does not have."""

import pytest
from pymavlink.dialects.v20 import all as dialect

from fleet_mavlink.constants import VEHICLE_TYPES, VTOLS, MavResult
from fleet_mavlink.event_messages import Event


def test_event_is_described_here_only_as_long_as_the_dialect_lacks_it():
    assert Event.message_id not in dialect.mavlink_map


@pytest.mark.parametrize("result", MavResult)
def test_a_result_has_a_number_of_its_own_only_as_long_as_the_dialect_lacks_it(result):
    known = getattr(dialect, f"MAV_RESULT_{result.name}", None)
    own = {MavResult.CANCELLED, MavResult.COMMAND_UNSUPPORTED_MAV_FRAME}
    assert known == (None if result in own else result)


@pytest.mark.parametrize("number", sorted(VEHICLE_TYPES.keys() - set(VTOLS)))
def test_a_vehicle_type_has_the_name_that_the_dialect_gives_it(number):
    name = dialect.enums["MAV_TYPE"][number].name
    assert VEHICLE_TYPES[number] == name.removeprefix("MAV_TYPE_").lower()
