"""One car: its trips in a store, the model that they teach, its diary, and what it sends while it drives."""

from tripwatt.live.diary import Diary, Score
from tripwatt.live.following import Broker, Follower, LiveForecaster
from tripwatt.live.live_car import LiveCar, LivePlan, is_live_car, issue_token, open_live_car
from tripwatt.live.live_trip import LiveTrip, TripFinder
from tripwatt.live.own_car import Learned, OwnCar, create_car, forget_car, is_car, open_car
from tripwatt.live.teaching import has_news, learn_finished
from tripwatt.live.telemetry import Sample, sample_from_abrp
from tripwatt.live.topics import TopicJoiner

__all__ = [
    "Broker",
    "Diary",
    "Follower",
    "Learned",
    "LiveCar",
    "LiveForecaster",
    "LivePlan",
    "LiveTrip",
    "OwnCar",
    "Sample",
    "Score",
    "TopicJoiner",
    "TripFinder",
    "create_car",
    "forget_car",
    "has_news",
    "is_car",
    "is_live_car",
    "issue_token",
    "learn_finished",
    "open_car",
    "open_live_car",
    "sample_from_abrp",
]
