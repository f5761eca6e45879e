"""One car: its trips in a store, the model adapted to them, its diary, and what it sends while it drives."""

from tripwatt.live.diary import Diary, Score
from tripwatt.live.following import Broker, Follower, MqttSettings
from tripwatt.live.live_trip import LiveTrip, TripFinder
from tripwatt.live.own_car import Car, Learned, create_car, forget_car, is_car, open_car
from tripwatt.live.road_car import RoadCar
from tripwatt.live.teaching import has_news, learn_finished
from tripwatt.live.telemetry import Sample, sample_from_abrp
from tripwatt.live.tokens import has_token, issue_token
from tripwatt.live.topics import TopicJoiner

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
