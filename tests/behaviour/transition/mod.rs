//! From one sky to another over time.

mod weather_changes;
