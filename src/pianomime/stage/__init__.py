"""The stage: an app in the browser, on this machine, in which songs are played and watched."""
