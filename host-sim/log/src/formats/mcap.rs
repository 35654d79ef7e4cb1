//! MCAP: for each group and source a topic of JSON messages, with their schema.

use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::records::MessageHeader;
use mcap::write::Writer;
use serde_json::{Map, Value, json};

use crate::recording::{Recording, RecordingError, Series, refuse};

pub(super) fn write(recording: &Recording) -> Result<Vec<u8>, RecordingError> {
    let mut writer = Writer::new(Cursor::new(Vec::new())).map_err(refuse)?;
    // Messages of all topics in the order of time, as readers want them.
    let mut messages: Vec<(u64, u16, u32, Vec<u8>)> = Vec::new();
    for group in &recording.groups {
        let mut by_source: BTreeMap<&str, Vec<&Series>> = BTreeMap::new();
        for channel in &group.channels {
            by_source.entry(&channel.source).or_default().push(channel);
        }
        for (source, channels) in by_source {
            let parts = [group.name.as_str(), source]
                .into_iter()
                .filter(|part| !part.is_empty());
            let topic = parts.fold(String::new(), |topic, part| format!("{topic}/{part}"));
            let topic = if topic.is_empty() {
                "/channels".to_owned()
            } else {
                topic
            };
            let properties: Map<String, Value> = channels
                .iter()
                .map(|c| (c.name.clone(), json!({"type": "number", "description": c.unit})))
                .collect();
            let schema = json!({"type": "object", "properties": properties}).to_string();
            let schema = writer
                .add_schema(&topic[1..], "jsonschema", schema.as_bytes())
                .map_err(refuse)?;
            let units = channels
                .iter()
                .map(|c| (c.name.clone(), c.unit.clone()))
                .collect();
            let id = writer
                .add_channel(schema, &topic, "json", &units)
                .map_err(refuse)?;
            for (k, time_s) in group.time_s.iter().enumerate() {
                if time_s.is_nan() || *time_s < 0.0 {
                    return Err(refuse(format!(
                        "row {}: time {time_s} s; MCAP counts from zero",
                        k + 2
                    )));
                }
                let values: Map<String, Value> = channels
                    .iter()
                    .filter(|c| c.values[k].is_finite())
                    .map(|c| (c.name.clone(), json!(c.values[k])))
                    .collect();
                let text = Value::Object(values).to_string();
                messages.push(((time_s * 1e9).round() as u64, id, k as u32, text.into_bytes()));
            }
        }
    }
    messages.sort_by_key(|(time, id, ..)| (*time, *id));
    for (log_time, channel_id, sequence, data) in messages {
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time,
            publish_time: log_time,
        };
        writer.write_to_known_channel(&header, &data).map_err(refuse)?;
    }
    writer.finish().map_err(refuse)?;
    Ok(writer.into_inner().into_inner())
}
