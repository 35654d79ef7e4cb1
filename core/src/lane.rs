//! What a picture of the lane says: the input that bus, law and checks share.

use crate::quantity::{Instant, Metres, Radians};
use crate::safety::redundant::words;

words! {
    /// Lane errors at the guidance's own points (t'_n = 0.3 s, t'_f = 0.7 s), ISO 8855: positive asks for a
    /// positive (left) torque.
    #[derive(Default)]
    pub struct LaneSample {
        /// Lateral error e_y' at the near point.
        pub e_y: Metres,
        /// Yaw error e_theta' at the far point.
        pub e_theta: Radians,
        /// The instant that it describes.
        pub at: Instant,
    }
}
