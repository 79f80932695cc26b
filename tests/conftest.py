"""Property tests draw the same examples every time, so that a result says something of the code under test.

`HYPOTHESIS_PROFILE=explore pytest` draws new ones: for a search of counterexamples, each of which becomes an example.
"""

import os

from hypothesis import settings

settings.register_profile("settled", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "settled"))
