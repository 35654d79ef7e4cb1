//! One root seed, named sub-streams: one more draw in one stream renumbers no other.

/// What draws random numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stream {
    /// The part of the driver's torque that the model does not explain.
    Remnant,
    /// Noise of the sensors.
    Sensors,
    /// Wind.
    World,
    /// When, how and to whom a fault happens.
    Faults,
    /// Which car of a population.
    Car,
    /// Which roads, drivers and winds a population of drives meets.
    Population,
    /// Noise of the yaw-rate sensor.
    Gyro,
}

impl Stream {
    /// The seed of this stream of a root. The remnant's is the root itself, as it was before there were streams.
    pub fn seed(self, root: u64) -> u64 {
        let name = match self {
            Self::Remnant => return root,
            Self::Sensors => 1,
            Self::World => 2,
            Self::Faults => 3,
            Self::Car => 4,
            Self::Population => 5,
            Self::Gyro => 6,
        };
        split_mix(split_mix(root) ^ name)
    }
}

/// The finaliser of SplitMix64 (Steele, Lea and Flood 2014): every bit of the input moves half of the output's.
fn split_mix(seed: u64) -> u64 {
    let z = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first outputs of SplitMix64 from seed 1234567, as Vigna's reference program prints them.
    #[test]
    fn the_mixer_has_its_published_values() {
        let mut state = 1_234_567_u64;
        for expected in [6_457_827_717_110_365_317, 3_203_168_211_198_807_973] {
            assert_eq!(split_mix(state), expected);
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        }
    }

    #[test]
    fn streams_and_roots_do_not_meet() {
        let streams = [
            Stream::Remnant,
            Stream::Sensors,
            Stream::World,
            Stream::Faults,
            Stream::Car,
            Stream::Population,
            Stream::Gyro,
        ];
        let seeds: std::collections::BTreeSet<u64> = (0..1000)
            .flat_map(|root| streams.map(|stream| stream.seed(root)))
            .collect();
        assert_eq!(seeds.len(), 7000);
        assert_eq!(Stream::Remnant.seed(7), 7);
    }
}
