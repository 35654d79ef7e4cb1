//! Recordings: channels, and the formats of other tools.

mod channels;
mod formats;
mod parquet;
