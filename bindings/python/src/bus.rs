//! The senders of the ECU's inputs: frames with counter and CRC, from SI values.

use haptic_core::bus::messages::{Column, LanePreview, MESSAGES, Message, Request, Vehicle};
use haptic_core::quantity::{Metres, Micros, Radians, Ratio, Speed, Torque, TurningRate};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyIterator, PyTuple};

use crate::errors::{clock, finite, whole, within};
use crate::pickle::Parts;

/// A classic CAN data frame; unpacks as ``id, data``.
///
/// Parameters
/// ----------
/// id : int
///     11-bit identifier.
/// data : bytes
///     Up to eight bytes.
#[pyclass(frozen, eq, hash, module = "haptic_guidance")]
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Frame {
    id: u16,
    len: u8,
    data: [u8; 8],
}

impl From<&haptic_core::bus::Frame> for Frame {
    fn from(frame: &haptic_core::bus::Frame) -> Self {
        let mut data = [0; 8];
        let payload = frame.data();
        data[..payload.len()].copy_from_slice(payload);
        Self {
            id: frame.id(),
            len: payload.len() as u8,
            data,
        }
    }
}

impl Frame {
    fn payload(&self) -> &[u8] {
        &self.data[..usize::from(self.len)]
    }

    /// Checks what came from outside.
    pub(crate) fn checked(py: Python<'_>, id: i64, data: &[u8]) -> PyResult<haptic_core::bus::Frame> {
        let most = haptic_core::bus::Frame::MAX_ID;
        within(py, "id", id as f64, [0.0, f64::from(most)], "")?;
        within(py, "length of data", data.len() as f64, [0.0, 8.0], "bytes")?;
        // In range as just checked.
        Ok(haptic_core::bus::Frame::new(id as u16, data).unwrap_or(haptic_core::bus::Frame::full(0, [0; 8])))
    }
}

#[pymethods]
impl Frame {
    #[new]
    fn new(py: Python<'_>, id: i64, data: std::borrow::Cow<'_, [u8]>) -> PyResult<Self> {
        Self::checked(py, id, &data).map(|frame| Self::from(&frame))
    }

    /// 11-bit identifier.
    #[getter]
    fn id(&self) -> u16 {
        self.id
    }

    /// Payload.
    #[getter]
    fn data<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, self.payload())
    }

    fn __iter__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyIterator>> {
        let pair = slf.arguments()?;
        pair.try_iter()
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, pyo3::types::PyType>, Bound<'py, PyTuple>)> {
        Ok((slf.get_type(), slf.arguments()?))
    }

    fn __repr__(&self) -> String {
        let bytes: String = self.payload().iter().map(|byte| format!("{byte:02X}")).collect();
        format!("Frame(0x{:03X}, bytes.fromhex('{bytes}'))", self.id)
    }
}

/// What makes a frame again.
trait Arguments<'py> {
    fn arguments(&self) -> PyResult<Bound<'py, PyTuple>>;
}

impl<'py> Arguments<'py> for Bound<'py, Frame> {
    fn arguments(&self) -> PyResult<Bound<'py, PyTuple>> {
        let frame = self.get();
        (frame.id, frame.data(self.py())).into_pyobject(self.py())
    }
}

/// The senders of what the ECU hears: camera, column, vehicle and host, each with its counter.
///
/// Values beyond what a message carries saturate, as a sensor does; one that is no finite number is refused.
#[pyclass(module = "haptic_guidance")]
#[derive(Clone, Copy, Default)]
pub(crate) struct Bus {
    /// The counter of each message of the list, and how many times it was due in `frames`.
    counters: PerMessage<u8>,
    due: PerMessage<u32>,
    start_us: Option<u64>,
}

/// A number for each message of the list.
type PerMessage<T> = [T; MESSAGES.len()];

/// The place of a message in the list.
fn place<M: Message>() -> usize {
    // Every message has its line there.
    MESSAGES.iter().position(|info| info.id == M::ID).unwrap_or(0)
}

impl Bus {
    fn send<M: Message>(&mut self, message: &M) -> Frame {
        let counter = &mut self.counters[place::<M>()];
        let frame = message.encode(*counter);
        *counter = counter.wrapping_add(1);
        Frame::from(&frame)
    }

    /// Whether the next frame of a message is due, `elapsed_us` after the start.
    fn is_due<M: Message>(&mut self, elapsed_us: u64) -> bool {
        let count = &mut self.due[place::<M>()];
        // Half a microsecond, because 15 times 8.333 ms is a little more than 125 ms in floating point.
        let is_due = elapsed_us as f64 + 0.5 >= f64::from(*count) * M::INFO.period_ms * 1e3;
        *count += u32::from(is_due);
        is_due
    }
}

#[pymethods]
impl Bus {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// From what `__reduce__` took apart.
    #[staticmethod]
    fn _of(counters: PerMessage<u8>, due: PerMessage<u32>, start_us: Option<u64>) -> Self {
        Self {
            counters,
            due,
            start_us,
        }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Parts<'py>> {
        let parts = (self.counters, self.due, self.start_us);
        Ok((py.get_type::<Self>().getattr("_of")?, parts.into_pyobject(py)?))
    }

    /// The lane preview of the camera, about every 8.3 ms.
    ///
    /// Parameters
    /// ----------
    /// e_y_m : float
    ///     Lateral error at the near point, m, positive: the target lies to the left.
    /// e_theta_rad : float
    ///     Heading of the road at the far point less the direction of movement, rad.
    /// age_us : int, optional
    ///     Age of the picture, microseconds, up to 204,700; the ECU uses none that is older than 150,000.
    /// valid : bool, optional
    ///     Whether the camera vouches for it.
    ///
    /// Returns
    /// -------
    /// Frame
    #[pyo3(signature = (e_y_m, e_theta_rad, *, age_us = 0, valid = true))]
    fn lane_preview(
        &mut self,
        py: Python<'_>,
        e_y_m: f64,
        e_theta_rad: f64,
        age_us: i64,
        valid: bool,
    ) -> PyResult<Frame> {
        let age_us = whole(py, "age_us", age_us, [0, 204_700], "us")?;
        let preview = LanePreview {
            e_y: Metres::from_m(finite(py, "e_y_m", e_y_m, "m")?),
            e_theta: Radians::from_rad(finite(py, "e_theta_rad", e_theta_rad, "rad")?),
            // In range as just checked.
            age: Micros::from_us(age_us as u32),
            valid,
        };
        Ok(self.send(&preview))
    }

    /// The column's sensors, every 2 ms.
    ///
    /// Parameters
    /// ----------
    /// driver_torque_nm, wheel_angle_rad : float
    ///     Torque of the driver, N.m, and angle of the wheel, rad, both positive to the left.
    /// motor_torque_nm : float
    ///     Torque that the motor delivers, N.m: what the ECU checks its actuator by.
    ///
    /// Returns
    /// -------
    /// Frame
    fn column(
        &mut self,
        py: Python<'_>,
        driver_torque_nm: f64,
        wheel_angle_rad: f64,
        motor_torque_nm: f64,
    ) -> PyResult<Frame> {
        let column = Column {
            driver_torque: Torque::from_nm(finite(py, "driver_torque_nm", driver_torque_nm, "N.m")?),
            wheel_angle: Radians::from_rad(finite(py, "wheel_angle_rad", wheel_angle_rad, "rad")?),
            motor_torque: Torque::from_nm(finite(py, "motor_torque_nm", motor_torque_nm, "N.m")?),
        };
        Ok(self.send(&column))
    }

    /// The vehicle's speed from two sources, every 10 ms.
    ///
    /// Parameters
    /// ----------
    /// speed_m_per_s : float
    ///     Speed, m/s.
    /// second_speed_m_per_s : float, optional
    ///     Of the second source, m/s; the same if not given.
    /// yaw_rate_rad_per_s : float, optional
    ///     Measured yaw rate, rad/s, positive to the left; None of a vehicle that does not measure it.
    ///
    /// Returns
    /// -------
    /// Frame
    #[pyo3(signature = (speed_m_per_s, second_speed_m_per_s = None, yaw_rate_rad_per_s = None))]
    fn vehicle(
        &mut self,
        py: Python<'_>,
        speed_m_per_s: f64,
        second_speed_m_per_s: Option<f64>,
        yaw_rate_rad_per_s: Option<f64>,
    ) -> PyResult<Frame> {
        let first = finite(py, "speed_m_per_s", speed_m_per_s, "m/s")?;
        let second = second_speed_m_per_s.unwrap_or(first);
        let second = finite(py, "second_speed_m_per_s", second, "m/s")?;
        let yaw_rate = yaw_rate_rad_per_s
            .map(|rate| finite(py, "yaw_rate_rad_per_s", rate, "rad/s"))
            .transpose()?;
        let vehicle = Vehicle {
            speeds: [first, second].map(Speed::from_m_per_s),
            yaw_rate: yaw_rate.map(TurningRate::from_rad_per_s),
        };
        Ok(self.send(&vehicle))
    }

    /// What the host wants, every 10 ms.
    ///
    /// Parameters
    /// ----------
    /// engage : bool
    ///     Guidance is wanted. The ECU takes only a rise of it, after half a second of valid data.
    /// authority : float, optional
    ///     Share of the guidance torque, 0 to 1.
    /// probe : bool, optional
    ///     The probe is wanted.
    ///
    /// Returns
    /// -------
    /// Frame
    #[pyo3(signature = (engage, *, authority = 1.0, probe = false))]
    fn request(&mut self, py: Python<'_>, engage: bool, authority: f64, probe: bool) -> PyResult<Frame> {
        let request = Request {
            engage,
            authority: Ratio::from_si(within(py, "authority", authority, [0.0, 1.0], "")?),
            probe,
        };
        Ok(self.send(&request))
    }

    /// The frames that are due at an instant, each sender at its own pace, from the first call on.
    ///
    /// Parameters
    /// ----------
    /// t_us : int
    ///     Time, microseconds.
    /// e_y_m, e_theta_rad : float or None
    ///     As of `lane_preview`; None for a camera that sees nothing.
    /// driver_torque_nm, wheel_angle_rad, motor_torque_nm : float
    ///     As of `column`.
    /// speed_m_per_s : float
    ///     As of `vehicle`.
    /// engage, authority, probe : optional
    ///     As of `request`.
    /// yaw_rate_rad_per_s : float, optional
    ///     As of `vehicle`.
    ///
    /// Returns
    /// -------
    /// list of Frame
    #[pyo3(signature = (t_us, *, e_y_m, e_theta_rad, driver_torque_nm, wheel_angle_rad, motor_torque_nm,
                        speed_m_per_s, engage = true, authority = 1.0, probe = false,
                        yaw_rate_rad_per_s = None))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn frames(
        &mut self,
        py: Python<'_>,
        t_us: i64,
        e_y_m: Option<f64>,
        e_theta_rad: Option<f64>,
        driver_torque_nm: f64,
        wheel_angle_rad: f64,
        motor_torque_nm: f64,
        speed_m_per_s: f64,
        engage: bool,
        authority: f64,
        probe: bool,
        yaw_rate_rad_per_s: Option<f64>,
    ) -> PyResult<Vec<Frame>> {
        // A copy, so that a refused value sends nothing.
        let mut bus = *self;
        let t_us = clock(py, t_us)?;
        let elapsed_us = t_us.saturating_sub(*bus.start_us.get_or_insert(t_us));
        let mut frames = Vec::with_capacity(4);
        if bus.is_due::<LanePreview>(elapsed_us)
            && let (Some(e_y_m), Some(e_theta_rad)) = (e_y_m, e_theta_rad)
        {
            frames.push(bus.lane_preview(py, e_y_m, e_theta_rad, 0, true)?);
        }
        if bus.is_due::<Column>(elapsed_us) {
            frames.push(bus.column(py, driver_torque_nm, wheel_angle_rad, motor_torque_nm)?);
        }
        if bus.is_due::<Vehicle>(elapsed_us) {
            frames.push(bus.vehicle(py, speed_m_per_s, None, yaw_rate_rad_per_s)?);
        }
        if bus.is_due::<Request>(elapsed_us) {
            frames.push(bus.request(py, engage, authority, probe)?);
        }
        *self = bus;
        Ok(frames)
    }
}
