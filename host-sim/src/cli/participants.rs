//! A list of participants on the command line: numbers and ranges such as `1,3..5`.

/// Their numbers, in the order given.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Participants(pub(super) Vec<u32>);

impl std::str::FromStr for Participants {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |s: &str| {
            s.trim()
                .parse::<u32>()
                .map_err(|_| format!("{s:?} is not a participant's number, as in 1,3..5"))
        };
        let mut all = Vec::new();
        for part in text.split(',') {
            match part.split_once("..") {
                Some((from, to)) => {
                    let (from, to) = (number(from)?, number(to.trim_start_matches('='))?);
                    if from > to || to > 1000 {
                        return Err(format!("{part:?} is no range of participants, as in 1,3..5"));
                    }
                    all.extend(from..=to);
                }
                None => all.push(number(part)?),
            }
        }
        Ok(Self(all))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_and_ranges() {
        for (text, numbers) in [
            ("3", &[3][..]),
            ("1, 5,9", &[1, 5, 9]),
            ("1,3..5", &[1, 3, 4, 5]),
            ("2..=3", &[2, 3]),
        ] {
            assert_eq!(text.parse(), Ok(Participants(numbers.to_vec())), "{text}");
        }
        for bad in ["", "a", "2..x", "5..3", "1..99999999"] {
            assert!(bad.parse::<Participants>().is_err(), "{bad}");
        }
    }
}
