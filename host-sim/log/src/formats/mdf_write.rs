//! ASAM MDF 4, written by the crate mdf4-rs: a group of channels each, all numbers of 64 bits.

use mdf4_rs::{DataType, DecodedValue, MdfWriter};

use super::mdf::SOURCE;
use crate::recording::{Recording, RecordingError, Series};

pub(super) fn write(recording: &Recording) -> Result<Vec<u8>, RecordingError> {
    let made = || -> mdf4_rs::Result<Vec<u8>> {
        let mut file = MdfWriter::in_memory();
        file.init_mdf_file()?;
        for group in &recording.groups {
            let id = file.add_channel_group(None, |_| {})?;
            file.set_channel_group_name(&id, &group.name)?;
            let time = Series {
                name: "time_s".into(),
                unit: "s".into(),
                source: "clock".into(),
                values: Vec::new(),
            };
            let mut before: Option<String> = None;
            for (i, channel) in std::iter::once(&time).chain(&group.channels).enumerate() {
                let made = file.add_channel(&id, before.as_deref(), |block| {
                    block.name = Some(channel.name.clone());
                    block.data_type = DataType::FloatLE;
                    block.bit_count = 64;
                })?;
                if i == 0 {
                    file.set_time_channel(&made)?;
                }
                file.set_channel_unit(&made, &channel.unit)?;
                file.set_channel_comment(&made, &format!("{SOURCE}{}", channel.source))?;
                before = Some(made);
            }
            file.start_data_block_for_cg(&id, 0)?;
            for (k, time_s) in group.time_s.iter().enumerate() {
                let values = std::iter::once(*time_s).chain(group.channels.iter().map(|c| c.values[k]));
                let record: Vec<DecodedValue> = values.map(DecodedValue::Float).collect();
                file.write_record(&id, &record)?;
            }
            file.finish_data_block(&id)?;
        }
        file.finalize()?;
        Ok(file.into_inner().into_inner())
    };
    made().map_err(|e| RecordingError(format!("{e:?}")))
}
