//! A workshop's tester: UDS over ISO-TP with a product on a bus, over the adapters that all of this crate uses.
//!
//! What is written passes the ECU's own checks: standstill, Standby, an answer to its challenge, and ten seconds since a reset.
//! Where nobody sends the speeds of a vehicle, as on a bench, the tester does. Not here: what the ECU keeps (`haptic_diag`).

use std::time::{Duration, Instant};

use haptic_core::bus::Frame;
use haptic_core::bus::messages::{ParameterStatus, WriteOutcome};
use haptic_core::safety::faults::Fault;
use haptic_diag::data::{Datum, LONGEST};
pub use haptic_diag::data::{Entry, Format, entries};
use haptic_diag::isotp::Link;
use haptic_diag::security::mac;
pub use haptic_diag::security::{BENCH_KEY, BYTES as KEY_BYTES, Key};
use haptic_diag::server::COMMIT;
use haptic_diag::trouble::{code_of, fault_of};
use haptic_diag::{REQUEST_ID, RESPONSE_ID};
use haptic_secoc::Keys;

use super::PilError;
use super::parameters::{Product, standing};

/// The ECU answers within 50 ms; adapter and computer take their own time.
const ANSWER_WITHIN: Duration = Duration::from_secs(5);
/// Our speeds are 10 ms apart, and the set is with the download within a quarter of a second.
const SPEED_PERIOD: Duration = Duration::from_millis(10);
const HANDED_OVER: Duration = Duration::from_millis(600);
/// So often is a set committed whose speeds were too old when it came.
const ATTEMPTS: u32 = 10;

/// What was read.
#[derive(Debug, Clone, PartialEq)]
pub enum Reading {
    /// Text.
    Text(String),
    /// A whole number.
    Whole(u32),
    /// A number; None where the ECU does not know it.
    Number(Option<f32>),
}

/// A fault that the ECU stored.
#[derive(Debug, Clone, PartialEq)]
pub struct Trouble {
    /// Its code, 24 bits.
    pub code: u32,
    /// The fault of that code; None for one of another list.
    pub fault: Option<Fault>,
    /// Its status, as ISO 14229-1 has it.
    pub status: u8,
    /// How often it appeared, if the ECU says so.
    pub count: Option<u8>,
    /// What was so when it last appeared.
    pub snapshot: Vec<(Entry, Reading)>,
}

/// A tester on a bus.
pub struct Tester {
    product: Product,
    link: Link<256, 64>,
    began: Instant,
    /// While our speeds are due: the next counter, and when it is.
    standing: Option<(u8, Instant)>,
}

impl Tester {
    /// Opens the way to a bus, named as for [`super::Target::Board`].
    ///
    /// # Errors
    /// What is missing on the way.
    pub fn on(adapter: &str) -> Result<Self, PilError> {
        Ok(Self {
            product: Product::on(adapter)?,
            link: Link::NEW,
            began: Instant::now(),
            standing: None,
        })
    }

    /// Proves under these keys what it sends beside its questions.
    pub fn prove(&mut self, keys: Option<&Keys>) {
        self.product.prove(keys);
    }

    /// The faults that the ECU stored.
    ///
    /// # Errors
    /// It does not answer, or refuses.
    pub fn troubles(&mut self) -> Result<Vec<Trouble>, PilError> {
        let answer = self.ask(&[0x19, 0x02, 0xFF])?;
        let (lines, _) = answer.get(3..).unwrap_or_default().as_chunks::<4>();
        let lines = lines.iter().filter(|[.., status]| *status != 0);
        lines
            .map(|[a, b, c, status]| self.trouble(*a, *b, *c, *status))
            .collect()
    }

    fn trouble(&mut self, a: u8, b: u8, c: u8, status: u8) -> Result<Trouble, PilError> {
        let counted = self.ask(&[0x19, 0x06, a, b, c, 0x01])?;
        let kept = self.ask(&[0x19, 0x04, a, b, c, 0x01])?;
        let code = u32::from_be_bytes([0, a, b, c]);
        Ok(Trouble {
            code,
            fault: fault_of(code),
            status,
            count: counted.get(7).copied(),
            // Behind code and status: the record's number, and how many data there are.
            snapshot: readings(kept.get(8..).unwrap_or_default())?,
        })
    }

    /// Forgets all of them.
    ///
    /// # Errors
    /// The ECU does not answer, or refuses.
    pub fn clear(&mut self) -> Result<(), PilError> {
        self.ask(&[0x10, 0x03])?;
        self.ask(&[0x14, 0xFF, 0xFF, 0xFF]).map(|_| ())
    }

    /// Reads one datum; None where the ECU cannot say now.
    ///
    /// # Errors
    /// It does not answer, or refuses for another reason.
    pub fn read(&mut self, entry: &Entry) -> Result<Option<Reading>, PilError> {
        let [high, low] = entry.id.to_be_bytes();
        match self.answer(&[0x22, high, low])? {
            Ok(answer) => {
                let bytes = answer.get(3..).unwrap_or_default();
                let (reading, _) = reading(entry, bytes)
                    .ok_or_else(|| PilError::Failed(format!("{}: {bytes:02X?} is no value", entry.name)))?;
                Ok(Some(reading))
            }
            Err(0x22) => Ok(None),
            Err(code) => Err(refusal(0x22, code)),
        }
    }

    /// Has the ECU store these values beside those in use, and waits until the set is.
    ///
    /// # Errors
    /// Why it is not in use.
    pub fn write(&mut self, values: &[(Entry, Reading)], key: &Key) -> Result<ParameterStatus, PilError> {
        let mut before = self.product.status()?;
        let mut attempts = 0;
        loop {
            attempts += 1;
            let result = self.store(&before, values, key);
            self.standing = None;
            match result? {
                Ok(now) => return Ok(now),
                Err((now, _)) if !self.product.hears_speed && attempts < ATTEMPTS && is_late(&now) => {
                    before = now
                }
                Err((_, why)) => return Err(PilError::Failed(why)),
            }
        }
    }

    fn store(
        &mut self,
        before: &ParameterStatus,
        values: &[(Entry, Reading)],
        key: &Key,
    ) -> Result<Result<ParameterStatus, (ParameterStatus, String)>, PilError> {
        self.unlock(key)?;
        for (entry, value) in values {
            let [high, low] = entry.id.to_be_bytes();
            let [a, b, c, d] = match value {
                Reading::Whole(number) => number.to_be_bytes(),
                Reading::Number(Some(number)) => number.to_be_bytes(),
                Reading::Number(None) | Reading::Text(_) => {
                    return Err(PilError::Failed(format!("{} takes a number", entry.name)));
                }
            };
            self.ask(&[0x2E, high, low, a, b, c, d])?;
        }
        if !self.product.hears_speed {
            self.standing = Some((self.product.send_standstill()?, Instant::now()));
        }
        let [high, low] = COMMIT.to_be_bytes();
        match self.answer(&[0x31, 0x01, high, low])? {
            Ok(_) => {}
            Err(code @ 0x88) => {
                let now = ParameterStatus {
                    outcome: WriteOutcome::NotStanding,
                    ..*before
                };
                return Ok(Err((now, refusal(0x31, code).to_string())));
            }
            Err(code) => return Err(refusal(0x31, code)),
        }
        let until = Instant::now() + HANDED_OVER;
        while Instant::now() < until {
            self.stand()?;
            self.product.port.frame()?;
        }
        self.product.outcome(before)
    }

    /// An extended session, and the answer to its challenge.
    fn unlock(&mut self, key: &Key) -> Result<(), PilError> {
        self.ask(&[0x10, 0x03])?;
        let answer = self.ask(&[0x27, 0x01])?;
        let challenge = answer.get(2..).unwrap_or_default();
        let mut proof = vec![0x27, 0x02];
        proof.extend(mac(key, challenge));
        self.ask(&proof).map(|_| ())
    }

    /// A positive answer.
    fn ask(&mut self, request: &[u8]) -> Result<Vec<u8>, PilError> {
        let service = request.first().copied().unwrap_or(0);
        self.answer(request)?.map_err(|code| refusal(service, code))
    }

    /// An answer: a positive one, or the code of a negative one.
    fn answer(&mut self, request: &[u8]) -> Result<Result<Vec<u8>, u8>, PilError> {
        let service = request.first().copied().unwrap_or(0);
        self.link.done();
        if !self.link.send(request) {
            return Err(PilError::Failed("the request is too long".into()));
        }
        let until = Instant::now() + ANSWER_WITHIN;
        while Instant::now() < until {
            self.stand()?;
            let now_ms = self.began.elapsed().as_millis() as u32;
            self.link.age(now_ms);
            while let Some(bytes) = self.link.frame(now_ms) {
                self.product.port.send(&[Frame::full(REQUEST_ID, bytes)])?;
                self.link.sent(now_ms);
            }
            if let Some(frame) = self
                .product
                .port
                .frame()?
                .filter(|frame| frame.id() == RESPONSE_ID)
            {
                self.link.receive(frame.data(), now_ms);
            }
            let Some(message) = self.link.message() else {
                continue;
            };
            let answer = message.bytes.to_vec();
            let is_whole = answer.len() == usize::from(message.length);
            self.link.done();
            match answer.as_slice() {
                [0x7F, of, 0x78] if *of == service => {}
                [0x7F, of, code] if *of == service => return Ok(Err(*code)),
                [first, ..] if *first == service | 0x40 && is_whole => return Ok(Ok(answer)),
                // An answer to somebody else.
                _ => {}
            }
        }
        Err(PilError::Failed(format!(
            "no ECU answered {service:#04X} on {RESPONSE_ID:#05X} within {} s: does it run an image with diagnosis, is the bus \
             terminated, and do adapter and ECU both run at 500 kbit/s?",
            ANSWER_WITHIN.as_secs()
        )))
    }

    /// Our speed, when it is due.
    fn stand(&mut self) -> Result<(), PilError> {
        if let Some((counter, due)) = &mut self.standing
            && Instant::now() >= *due
        {
            *due = Instant::now() + SPEED_PERIOD;
            self.product.port.send(&[standing(counter)])?;
        }
        Ok(())
    }
}

/// Our own speeds were too old when the set came, or its unlocking was.
fn is_late(now: &ParameterStatus) -> bool {
    matches!(now.outcome, WriteOutcome::NotStanding | WriteOutcome::NotUnlocked)
}

/// Data with their identifiers, one behind the other.
fn readings(mut bytes: &[u8]) -> Result<Vec<(Entry, Reading)>, PilError> {
    let mut readings = Vec::new();
    while let Some((id, rest)) = bytes.split_first_chunk::<2>() {
        let id = u16::from_be_bytes(*id);
        let unknown = || {
            PilError::Failed(format!(
                "the ECU names {id:#06X}, which this program does not know"
            ))
        };
        let entry = Datum::of(id).map(Datum::entry).ok_or_else(unknown)?;
        let (reading, rest) = reading(&entry, rest).ok_or_else(unknown)?;
        readings.push((entry, reading));
        bytes = rest;
    }
    Ok(readings)
}

/// A value, and what follows it.
fn reading<'a>(entry: &Entry, bytes: &'a [u8]) -> Option<(Reading, &'a [u8])> {
    match entry.format {
        Format::Text => {
            let (text, rest) = bytes.split_at(bytes.len().min(LONGEST));
            Some((Reading::Text(String::from_utf8_lossy(text).into_owned()), rest))
        }
        Format::Unsigned(count) => {
            let (number, rest) = bytes.split_at_checked(count.into())?;
            let number = number
                .iter()
                .fold(0, |number, byte| number << 8 | u32::from(*byte));
            Some((Reading::Whole(number), rest))
        }
        Format::Float => {
            let (number, rest) = bytes.split_first_chunk()?;
            let number = f32::from_be_bytes(*number);
            Some((Reading::Number((!number.is_nan()).then_some(number)), rest))
        }
        _ => None,
    }
}

/// Every code of a fault that there is.
pub fn codes() -> impl Iterator<Item = (u32, Fault)> {
    Fault::ALL.into_iter().map(|fault| (code_of(fault), fault))
}

/// The datum or the parameter of a name.
#[must_use]
pub fn named(name: &str) -> Option<Entry> {
    entries().find(|entry| entry.name == name)
}

/// A negative answer, in words that say what to do.
fn refusal(service: u8, code: u8) -> PilError {
    let why = match code {
        0x11 => "it has no such service: its image is older",
        0x12 => "it has no such function: its image is older",
        0x13 => "the request has a length that it does not take",
        0x21 => "it is busy with the last set; try again in a second",
        0x22 => {
            "its conditions are not those: it has to be in Standby, ten seconds after a reset at the earliest, with a key in \
             its flash"
        }
        0x24 => "something has to come before, or nothing was written",
        0x31 => "the value or the name is none that it takes",
        0x33 => "it was not unlocked",
        0x35 => "the key is not its own",
        0x36 => "the key is not its own; it takes the next in ten seconds",
        0x37 => "wrong keys came before; it takes the next in ten seconds",
        0x7E | 0x7F => "its session ended",
        0x88 => "the vehicle moves, or nobody says that it stands",
        _ => "for a reason of its own",
    };
    PilError::Failed(format!(
        "the ECU refused service {service:#04X} with {code:#04X}: {why}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_are_taken_apart_by_their_list() {
        let bytes = [
            0x03, 0x00, 0x02, 0x03, 0x02, 0xBF, 0x80, 0x00, 0x00, 0x03, 0x12, 0x7F, 0xC0, 0x00, 0x00, 0x03,
            0x04, 0, 1, 2, 3,
        ];
        let got: Vec<_> = readings(&bytes)
            .unwrap()
            .into_iter()
            .map(|(entry, reading)| (entry.name, reading))
            .collect();
        assert_eq!(
            got,
            [
                ("mode", Reading::Whole(2)),
                ("guidance_torque", Reading::Number(Some(-1.0))),
                ("speed", Reading::Number(None)),
                ("uptime", Reading::Whole(0x1_0203)),
            ]
        );
        for cut in [1, 4, 6, 20] {
            let all = readings(&bytes[..cut]);
            assert!(all.is_err() || all.unwrap().len() < 4, "{cut}");
        }
        assert!(
            readings(&[0x77, 0x77, 0])
                .unwrap_err()
                .to_string()
                .contains("0x7777")
        );
        assert_eq!(named("torque_limit_nm").unwrap().format, Format::Float);
        assert_eq!(named("no such name"), None);
    }

    #[test]
    fn a_refusal_says_what_to_do() {
        let text = refusal(0x27, 0x37).to_string();
        assert!(text.contains("0x27") && text.contains("ten seconds"), "{text}");
    }
}
