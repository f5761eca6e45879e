from .columns import (
    COLUMNS as COLUMNS,
)
from .columns import (
    DEPARTURE_BOUNDS as DEPARTURE_BOUNDS,
)
from .columns import (
    LINK_COLUMNS as LINK_COLUMNS,
)
from .columns import (
    QUANTITIES as QUANTITIES,
)
from .columns import (
    REQUIRED_COLUMNS as REQUIRED_COLUMNS,
)
from .columns import (
    STEEPEST_GRADE as STEEPEST_GRADE,
)
from .columns import (
    Column as Column,
)
from .columns import (
    raise_faults as raise_faults,
)
from .columns import (
    scalar_faults as scalar_faults,
)
from .departure import (
    ASKED as ASKED,
)
from .departure import (
    EXTRAS as EXTRAS,
)
from .departure import (
    FIELDS as FIELDS,
)
from .departure import (
    SIGNALS as SIGNALS,
)
from .departure import (
    TEMPERATURES as TEMPERATURES,
)
from .departure import (
    TERRAINS as TERRAINS,
)
from .departure import (
    Context as Context,
)
from .departure import (
    Departure as Departure,
)
from .departure import (
    require_departure as require_departure,
)
from .energy import (
    observed_cumulative_energy as observed_cumulative_energy,
)
from .energy import (
    observed_energy as observed_energy,
)
from .fields import (
    Field as Field,
)
from .flags import (
    Flag as Flag,
)
from .gaps import (
    MAX_DURATION_S as MAX_DURATION_S,
)
from .gaps import (
    gap_flags as gap_flags,
)
from .gaps import (
    time_faults as time_faults,
)
from .plan import (
    ROUTE_COLUMNS as ROUTE_COLUMNS,
)
from .plan import (
    Pause as Pause,
)
from .plan import (
    Plan as Plan,
)
from .samples import (
    Sampled as Sampled,
)
from .samples import (
    bin_means as bin_means,
)
from .samples import (
    table_of as table_of,
)
from .schema import (
    structure_faults as structure_faults,
)
from .schema import (
    validate_samples as validate_samples,
)
from .schema import (
    value_faults as value_faults,
)
from .trip import (
    Log as Log,
)
from .trip import (
    Recorded as Recorded,
)
from .trip import (
    Trip as Trip,
)
from .trip import (
    TripSet as TripSet,
)
from .trip import (
    require_unique_ids as require_unique_ids,
)
from .trip import (
    resample as resample,
)
from .weather import (
    PlanWeather as PlanWeather,
)
