//! A BLF file of frames, in deflated containers.

use std::io::{self, Seek, SeekFrom, Write};

use super::{CAN_MESSAGE, CONTAINER, EXTENDED, FD_MESSAGE, OBJECT, SIGNATURE};
use crate::bus::{BusFrame, Form, Numbers, length_code};
use crate::formats::calendar;

const HEADING: u32 = 144;

/// A file that is being written; its heading is written last, when the sums are known.
pub(in crate::formats) struct Writer<W> {
    out: W,
    pub(in crate::formats) numbers: Numbers,
    inside: Vec<u8>,
    /// Milliseconds of the first and the last frame.
    span_ms: Option<[u64; 2]>,
    uncompressed: u64,
    frames: u32,
}

const MOST: usize = 128 * 1024;

impl<W: Write + Seek> Writer<W> {
    pub(in crate::formats) fn new(mut out: W) -> io::Result<Self> {
        out.write_all(&[0; HEADING as usize])?;
        Ok(Self {
            out,
            numbers: Numbers::default(),
            inside: Vec::with_capacity(MOST),
            span_ms: None,
            uncompressed: HEADING.into(),
            frames: 0,
        })
    }

    pub(in crate::formats) fn frame(&mut self, frame: &BusFrame) -> io::Result<()> {
        let time_ns = (frame.time_s.max(0.0) * 1e9).round() as u64;
        let now_ms = time_ns / 1_000_000;
        let [start_ms, stop_ms] = self.span_ms.get_or_insert([now_ms; 2]);
        *stop_ms = now_ms;
        let since_ns = time_ns.saturating_sub(*start_ms * 1_000_000);
        let id = frame.id | if frame.extended { EXTENDED } else { 0 };
        let length = frame.data.len() as u8;
        let mut body = self.numbers.of(&frame.bus).to_le_bytes().to_vec();
        body.extend([u8::from(frame.sent), length_code(frame.data.len())]);
        body.extend(id.to_le_bytes());
        let kind = match frame.form {
            Form::Classic => CAN_MESSAGE,
            Form::Fd { switched, passive } => {
                let bits = 1 | u8::from(switched) << 1 | u8::from(passive) << 2;
                body.extend([0, 0, 0, 0, 0, bits, length, 0, 0, 0, 0, 0]);
                FD_MESSAGE
            }
        };
        let most = body.len() + frame.form.most_bytes();
        body.extend(&frame.data);
        body.resize(most, 0);
        let inside = &mut self.inside;
        inside.extend_from_slice(OBJECT);
        inside.extend_from_slice(&32_u16.to_le_bytes());
        inside.extend_from_slice(&1_u16.to_le_bytes());
        inside.extend_from_slice(&(32 + body.len() as u32).to_le_bytes());
        inside.extend_from_slice(&kind.to_le_bytes());
        // Nanoseconds.
        inside.extend_from_slice(&2_u32.to_le_bytes());
        inside.extend_from_slice(&[0; 4]);
        inside.extend_from_slice(&since_ns.to_le_bytes());
        inside.append(&mut body);
        self.frames += 1;
        if self.inside.len() + 128 > MOST {
            self.close()?;
        }
        Ok(())
    }

    /// Writes a container.
    fn close(&mut self) -> io::Result<()> {
        let packed = miniz_oxide::deflate::compress_to_vec_zlib(&self.inside, 6);
        let size = 32 + packed.len() as u32;
        let mut head = OBJECT.to_vec();
        head.extend_from_slice(&16_u16.to_le_bytes());
        head.extend_from_slice(&1_u16.to_le_bytes());
        head.extend_from_slice(&size.to_le_bytes());
        head.extend_from_slice(&CONTAINER.to_le_bytes());
        head.extend_from_slice(&[2, 0, 0, 0, 0, 0, 0, 0]);
        head.extend_from_slice(&(self.inside.len() as u32).to_le_bytes());
        head.extend_from_slice(&[0; 4]);
        self.out.write_all(&head)?;
        self.out.write_all(&packed)?;
        self.out.write_all(&[0; 4][..size as usize % 4])?;
        self.uncompressed += 32 + self.inside.len() as u64;
        self.inside.clear();
        Ok(())
    }

    pub(in crate::formats) fn finish(mut self) -> io::Result<()> {
        if !self.inside.is_empty() {
            self.close()?;
        }
        let size = self.out.stream_position()?;
        let mut head = SIGNATURE.to_vec();
        head.extend_from_slice(&HEADING.to_le_bytes());
        head.extend_from_slice(&[5, 0, 0, 0, 2, 6, 8, 1]);
        head.extend_from_slice(&size.to_le_bytes());
        head.extend_from_slice(&self.uncompressed.to_le_bytes());
        head.extend_from_slice(&self.frames.to_le_bytes());
        head.extend_from_slice(&[0; 4]);
        for part in self
            .span_ms
            .unwrap_or_default()
            .map(calendar::date)
            .as_flattened()
        {
            head.extend_from_slice(&part.to_le_bytes());
        }
        self.out.seek(SeekFrom::Start(0))?;
        self.out.write_all(&head)?;
        self.out.flush()
    }
}
