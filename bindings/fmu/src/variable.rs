//! Variables of a model: the one list that both standards' descriptions and every access follow from.

use haptic_sim::fields::Field;

/// What a variable is to FMI.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Set by others at every step.
    Input,
    /// Read after it.
    Output,
    /// Set before the start.
    Parameter,
    /// Set before the start, and between steps where the model takes it.
    Tunable,
}

/// The type of a variable; all are kept as numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A quantity.
    Real,
    /// A code or a word of bits.
    Integer,
    /// 0 or 1.
    Boolean,
    /// A name or a path.
    Text,
}

/// One variable; its value reference is its place in the model's list.
#[derive(Debug, Clone, Copy)]
pub struct Variable {
    /// Name, with its unit.
    pub name: &'static str,
    /// Type.
    pub kind: Kind,
    /// Role.
    pub role: Role,
    /// SI unit, empty if it has none.
    pub unit: &'static str,
    /// Value at the start.
    pub start: f64,
    /// Value of a text at the start.
    pub text: &'static str,
    /// Least and largest value, if there are such.
    pub range: Option<[f64; 2]>,
    /// What it is.
    pub meaning: &'static str,
}

/// A variable that starts at zero and has no range.
#[must_use]
pub const fn variable(
    name: &'static str,
    kind: Kind,
    role: Role,
    unit: &'static str,
    meaning: &'static str,
) -> Variable {
    Variable {
        name,
        kind,
        role,
        unit,
        start: 0.0,
        text: "",
        range: None,
        meaning,
    }
}

/// An input that starts at zero.
#[must_use]
pub const fn input(
    name: &'static str,
    unit: &'static str,
    range: [f64; 2],
    meaning: &'static str,
) -> Variable {
    Variable {
        range: Some(range),
        ..variable(name, Kind::Real, Role::Input, unit, meaning)
    }
}

/// What inputs can be at all. A bus saturates before that; what is beyond is a mistake of whoever couples the units.
pub mod limits {
    /// A lateral error, m.
    pub const LATERAL_M: [f64; 2] = [-100.0, 100.0];
    /// A yaw error, rad: half a turn.
    pub const YAW_RAD: [f64; 2] = [-3.2, 3.2];
    /// An angle of the steering wheel, rad: three turns.
    pub const WHEEL_RAD: [f64; 2] = [-20.0, 20.0];
    /// A torque on the column, N.m.
    pub const TORQUE_NM: [f64; 2] = [-100.0, 100.0];
    /// A speed, m/s.
    pub const SPEED_M_PER_S: [f64; 2] = [0.0, 100.0];
    /// A yaw rate, rad/s.
    pub const YAW_RATE_RAD_PER_S: [f64; 2] = [-10.0, 10.0];
}

/// T_d, where others say what it is.
pub const fn driver_torque() -> Variable {
    let meaning = "Torque of the driver on the column";
    input("driver_torque_nm", "N.m", limits::TORQUE_NM, meaning)
}

/// T_h, where others say what it is.
pub const fn guidance_torque() -> Variable {
    let meaning = "Torque of the guidance on the column";
    input("guidance_torque_nm", "N.m", limits::TORQUE_NM, meaning)
}

/// phi, where others say what it is.
pub const fn wheel_angle() -> Variable {
    let meaning = "Angle of the steering wheel";
    input("wheel_angle_rad", "rad", limits::WHEEL_RAD, meaning)
}

/// A list of variables, one line each: how it is made, and of what.
macro_rules! variables {
    ($($make:ident $($argument:expr),*;)*) => {
        [$($make($($argument),*)),*]
    };
}
pub(crate) use variables;

/// A parameter with its start and range.
#[must_use]
pub const fn parameter(
    name: &'static str,
    unit: &'static str,
    start: f64,
    range: [f64; 2],
    meaning: &'static str,
) -> Variable {
    Variable {
        start,
        range: Some(range),
        ..variable(name, Kind::Real, Role::Parameter, unit, meaning)
    }
}

/// A field of a scenario as a parameter; its start is the field's default, or zero if that is none.
#[must_use]
pub const fn of_field(field: &Field) -> Variable {
    let start = match field.default {
        Some(start) => start,
        None => 0.0,
    };
    parameter(field.name, field.unit, start, field.ends(), field.meaning)
}
