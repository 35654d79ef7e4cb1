//! Recordings: channels, and the formats of other tools.

mod buses;
mod channels;
mod formats;
mod parquet;
mod tables;
