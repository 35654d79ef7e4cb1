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
    /// Which values a sweep draws.
    Design,
    /// The roots of a sweep's drives.
    Drives,
    /// Noise of a torsion bar's sensor.
    Bar,
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
            Self::Design => 7,
            Self::Drives => 8,
            Self::Bar => 9,
        };
        split_mix(split_mix(root) ^ name)
    }
}

/// The seed of a stream within a stream, by its name: one more name renumbers no other.
pub fn named(seed: u64, name: &str) -> u64 {
    // FNV-1a spreads the name over 64 bits, the mixer spreads those.
    let hash = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3);
    split_mix(seed ^ name.bytes().fold(0xCBF2_9CE4_8422_2325, hash))
}

/// The `n`-th number of SplitMix64, from 0, without those before it.
pub fn nth(seed: u64, n: u64) -> u64 {
    split_mix(seed.wrapping_add(n.wrapping_mul(0x9E37_79B9_7F4A_7C15)))
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
        assert_eq!(nth(1_234_567, 1), 3_203_168_211_198_807_973);
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
            Stream::Design,
            Stream::Drives,
        ];
        let seeds: std::collections::BTreeSet<u64> = (0..1000)
            .flat_map(|root| streams.map(|stream| stream.seed(root)))
            .collect();
        assert_eq!(seeds.len(), 9000);
        assert_eq!(Stream::Remnant.seed(7), 7);
        assert_ne!(named(1, "driver.t_p_s"), named(1, "driver.t_n_s"));
    }
}
