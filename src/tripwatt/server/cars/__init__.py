"""One car: its trips in a store, the model adapted to them, its diary, and what it sends while it drives."""

from tripwatt.server.cars.diary import Diary, Score
from tripwatt.server.cars.following import Broker, Follower, MqttSettings
from tripwatt.server.cars.live_trip import LiveTrip, TripFinder
from tripwatt.server.cars.own_car import Car, Learned, create_car, forget_car, is_car, open_car
from tripwatt.server.cars.road_car import RoadCar
from tripwatt.server.cars.teaching import has_news, learn_finished
from tripwatt.server.cars.telemetry import Sample, sample_from_abrp
from tripwatt.server.cars.tokens import has_token, issue_token
from tripwatt.server.cars.topics import TopicJoiner

__all__ = [
    "Broker",
    "Car",
    "Diary",
    "Follower",
    "Learned",
    "LiveTrip",
    "MqttSettings",
    "RoadCar",
    "Sample",
    "Score",
    "TopicJoiner",
    "TripFinder",
    "create_car",
    "forget_car",
    "has_news",
    "has_token",
    "is_car",
    "issue_token",
    "learn_finished",
    "open_car",
    "sample_from_abrp",
]
