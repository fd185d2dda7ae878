"""Pages are tried in one browser; machines of finite elements are made once in a run of the suite."""

from tests.chromium import browser as browser
from tests.chromium import tab as tab
from tests.physics.thermal.shared_machines import shared_machines as shared_machines
