//! MCAP logs of Farside runs: write, read, verify, diff, recover.
