//! The one list of what can be read, by data identifier. The parameters follow at [`PARAMETERS_AT`], in their own list's order.
//!
//! Numbers are big-endian, as UDS has them.

use haptic_core::bus::Frame;
use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{Column, LanePreview, Message, Vehicle};
use haptic_core::controller::params::{PARAMETERS, Parameter};
use heapless::Vec;

/// The data identifier of the first parameter; the others count up from it. Each is a binary32, SI.
pub const PARAMETERS_AT: u16 = 0x1000;
/// Bytes of a datum at most.
pub const LONGEST: usize = 24;

/// How a datum lies in its bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// ASCII, of no fixed length.
    Text,
    /// An unsigned number of so many bytes.
    Unsigned(u8),
    /// A binary32 of IEEE 754; not a number where it is not known.
    Float,
}

/// What the list says of a datum.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Entry {
    /// Its data identifier.
    pub id: u16,
    /// Its name.
    pub name: &'static str,
    /// How it lies in its bytes.
    pub format: Format,
    /// SI unit; `1` if it has none.
    pub unit: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// Whether it can be written.
    pub is_written: bool,
    /// Least and largest value of a parameter.
    pub range: Option<[f64; 2]>,
}

macro_rules! data {
    ($($id:literal $name:ident $text:literal, $format:expr, $unit:literal, $access:ident, $meaning:literal;)*) => {
        /// What can be read beside the parameters.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Datum {
            $(#[doc = $meaning] $name,)*
        }

        impl Datum {
            /// Every one, in the order of the identifiers.
            pub const ALL: [Self; [$($id),*].len()] = [$(Self::$name),*];

            /// Its line of the list.
            #[must_use]
            pub const fn entry(self) -> Entry {
                match self {
                    $(Self::$name => Entry {
                        id: $id, name: $text, format: $format, unit: $unit, meaning: $meaning, is_written: Access::$access.is_written(), range: None,
                    },)*
                }
            }

            /// The datum of an identifier.
            #[must_use]
            pub const fn of(id: u16) -> Option<Self> {
                match id {
                    $($id => Some(Self::$name),)*
                    _ => None,
                }
            }
        }
    };
}

#[derive(Clone, Copy)]
enum Access {
    Read,
    Write,
}

impl Access {
    const fn is_written(self) -> bool {
        matches!(self, Self::Write)
    }
}

use Format::{Float, Text, Unsigned};

data! {
    0x0200 Layout "stored_layout", Unsigned(4), "1", Read, "version of the layout of stored parameters";
    0x0201 Sequence "stored_set", Unsigned(4), "1", Read, "number of the stored set in use; 0: that of the image";
    0x0202 VehicleNumber "vehicle_number", Unsigned(4), "1", Write, "number of the vehicle that the set is for; 0: nobody said";
    0x0203 Copies "stored_copies", Unsigned(1), "1", Read, "1 while a copy of the parameters cannot be read, otherwise 0";
    0x0204 Outcome "last_set", Unsigned(1), "1", Read, "what became of the last set that was sent, as ParameterStatus_Outcome";
    0x0300 Mode "mode", Unsigned(1), "1", Read, "mode, as Guidance_Mode";
    0x0301 Faults "faults", Unsigned(4), "1", Read, "faults present, a bit each";
    0x0302 Torque "guidance_torque", Float, "N.m", Read, "T_h, the guidance torque";
    0x0303 Reset "reset_cause", Unsigned(1), "1", Read, "why the ECU started, as Guidance_Reset";
    0x0304 Uptime "uptime", Unsigned(4), "ms", Read, "time since the start";
    0x0305 Rejected "rejected_frames", Unsigned(4), "1", Read, "frames that were not used since the start";
    0x0310 DriverTorque "driver_torque", Float, "N.m", Read, "T_d, as the last good frame had it";
    0x0311 WheelAngle "wheel_angle", Float, "rad", Read, "phi, as the last good frame had it";
    0x0312 Speed "speed", Float, "m/s", Read, "the first of the speeds, as the last good frame had it";
    0x0313 LateralError "lateral_error", Float, "m", Read, "e_y', as the last good frame had it";
    0xF186 Session "active_session", Unsigned(1), "1", Read, "diagnostic session: 1 default, 3 extended";
    0xF188 Commit "software_commit", Text, "1", Read, "commit that the image was built from, or that nobody said";
    0xF189 Software "software_version", Text, "1", Read, "version of the software";
    0xF18C Hardware "processor", Unsigned(4), "1", Read, "this processor's own number";
    0xF193 Bus "bus_version", Text, "1", Read, "version of the bus: identifiers and layouts";
}

/// The parameter of an identifier, with its place in the list.
#[must_use]
pub fn parameter_of(id: u16) -> Option<(usize, &'static Parameter)> {
    const LIST: &[Parameter] = &PARAMETERS;
    let place = usize::from(id.checked_sub(PARAMETERS_AT)?);
    LIST.get(place).map(|parameter| (place, parameter))
}

/// Everything that can be read, parameters too.
pub fn entries() -> impl Iterator<Item = Entry> {
    let parameters = PARAMETERS.into_iter().zip(PARAMETERS_AT..);
    Datum::ALL
        .map(Datum::entry)
        .into_iter()
        .chain(parameters.map(|(parameter, id)| Entry {
            id,
            name: parameter.name,
            format: Float,
            unit: parameter.unit,
            meaning: parameter.meaning,
            is_written: true,
            range: Some([parameter.min, parameter.max]),
        }))
}

/// A value, as it goes into an answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// A byte.
    Byte(u8),
    /// Four bytes.
    Word(u32),
    /// A number.
    Float(f32),
    /// ASCII; what is longer than [`LONGEST`] is cut.
    Text(&'static str),
}

impl Value {
    /// Its bytes.
    #[must_use]
    pub fn bytes(self) -> Vec<u8, LONGEST> {
        let mut bytes = Vec::new();
        match self {
            Self::Byte(byte) => bytes.extend([byte]),
            Self::Word(word) => bytes.extend(word.to_be_bytes()),
            Self::Float(number) => bytes.extend(number.to_be_bytes()),
            Self::Text(text) => bytes.extend(text.bytes().take(LONGEST)),
        }
        bytes
    }
}

/// What the bus said last; not a number where no good frame has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heard {
    /// T_d, N.m.
    pub driver_torque_nm: f32,
    /// phi, rad.
    pub wheel_angle_rad: f32,
    /// The first speed, m/s.
    pub speed_m_per_s: f32,
    /// e_y', m.
    pub lateral_error_m: f32,
}

/// The last frame of each input, to be decoded when somebody asks.
#[derive(Debug, Clone, Default)]
pub struct Ear {
    column: Option<Frame>,
    vehicle: Option<Frame>,
    lane: Option<Frame>,
}

impl Ear {
    /// Keeps a frame of an input. It is not judged: that is the controller's work.
    pub fn hear(&mut self, frame: &Frame) {
        match frame.id() {
            Column::ID => self.column = Some(*frame),
            Vehicle::ID => self.vehicle = Some(*frame),
            LanePreview::ID => self.lane = Some(*frame),
            _ => {}
        }
    }

    /// What the frames say, by their CRC alone.
    #[must_use]
    #[expect(clippy::as_conversions, reason = "a tester reads a binary32")]
    pub fn heard(&self) -> Heard {
        let column: Option<Column> = decoded(self.column.as_ref());
        let vehicle: Option<Vehicle> = decoded(self.vehicle.as_ref());
        let lane: Option<LanePreview> = decoded(self.lane.as_ref());
        let [driver, wheel] = column.map_or([f32::NAN; 2], |column| {
            [column.driver_torque.nm() as f32, column.wheel_angle.rad() as f32]
        });
        Heard {
            driver_torque_nm: driver,
            wheel_angle_rad: wheel,
            speed_m_per_s: vehicle.map_or(f32::NAN, |vehicle| {
                let [first, _] = vehicle.speeds;
                first.m_per_s() as f32
            }),
            lateral_error_m: lane.map_or(f32::NAN, |lane| lane.e_y.m() as f32),
        }
    }
}

fn decoded<M: Message>(frame: Option<&Frame>) -> Option<M> {
    M::decode(&mut { ReceiverState::TRUSTED }, frame?).ok()
}
