"""Pages are tried in one browser."""

from tests.chromium import browser as browser
from tests.chromium import shown as shown
from tests.chromium import tab as tab
