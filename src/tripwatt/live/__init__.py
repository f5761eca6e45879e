"""One car and its diary: its trips in a store, the model that they teach, and every forecast beside what it took."""

from tripwatt.live.diary import Diary, Score
from tripwatt.live.own_car import Learned, OwnCar, create_car, forget_car, is_car, open_car

__all__ = ["Diary", "Learned", "OwnCar", "Score", "create_car", "forget_car", "is_car", "open_car"]
