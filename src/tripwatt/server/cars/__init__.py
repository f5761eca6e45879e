"""One car: its trips, the model adapted to them, its diary, and what it sends while it drives."""

from tripwatt.server.cars.car import Car
from tripwatt.server.cars.folder import (
    create_car,
    forget_car,
    is_car,
    issue_token,
    open_car,
)
from tripwatt.server.cars.following import Broker, Follower, MqttSettings
from tripwatt.server.cars.learning import Learned
from tripwatt.server.cars.telemetry import Sample, sample_from_abrp
from tripwatt.server.cars.topics import TopicJoiner

__all__ = [
    "Broker",
    "Car",
    "Follower",
    "Learned",
    "MqttSettings",
    "Sample",
    "TopicJoiner",
    "create_car",
    "forget_car",
    "is_car",
    "issue_token",
    "open_car",
    "sample_from_abrp",
]
