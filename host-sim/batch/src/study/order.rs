//! In which order a participant meets the conditions.

use serde::{Deserialize, Serialize};

/// How orders are made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// Each condition as often in each place, and as often behind each other one (Williams 1949).
    #[default]
    BalancedLatinSquare,
    /// Each condition as often in each place.
    LatinSquare,
    /// The order in which they are listed, for everybody.
    Listed,
}

impl Order {
    /// Orders of `conditions` conditions; participants take them in turn.
    pub fn rows(self, conditions: usize) -> Vec<Vec<usize>> {
        let n = conditions;
        match self {
            Self::Listed => vec![(0..n).collect()],
            Self::LatinSquare => rotated(&(0..n).collect::<Vec<_>>()),
            Self::BalancedLatinSquare => {
                // 0, 1, n-1, 2, n-2, ...: every difference of neighbours once.
                let zigzag = |place: usize| match (place, place % 2) {
                    (0, _) => 0,
                    (_, 1) => place.div_ceil(2),
                    _ => n - place / 2,
                };
                let mut rows = rotated(&(0..n).map(zigzag).collect::<Vec<_>>());
                // Of an odd number one square holds only half of the pairs; its mirror holds the others.
                if n % 2 == 1 && n > 1 {
                    let mirrored: Vec<Vec<usize>> = rows
                        .iter()
                        .map(|row| row.iter().rev().copied().collect())
                        .collect();
                    rows.extend(mirrored);
                }
                rows
            }
        }
    }
}

fn rotated(first: &[usize]) -> Vec<Vec<usize>> {
    let n = first.len();
    (0..n)
        .map(|by| first.iter().map(|condition| (condition + by) % n).collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_conditions_have_the_square_of_the_textbooks() {
        let rows: Vec<String> = Order::BalancedLatinSquare
            .rows(4)
            .iter()
            .map(|row| row.iter().map(|c| char::from(b'A' + *c as u8)).collect())
            .collect();
        assert_eq!(rows, ["ABDC", "BCAD", "CDBA", "DACB"]);
    }

    #[test]
    fn each_condition_is_as_often_in_each_place_and_behind_each_other_one() {
        for n in 1..9 {
            let rows = Order::BalancedLatinSquare.rows(n);
            assert_eq!(rows.len(), if n % 2 == 0 || n == 1 { n } else { 2 * n }, "{n}");
            let count = |found: &dyn Fn(&Vec<usize>) -> bool| rows.iter().filter(|row| found(row)).count();
            for a in 0..n {
                for place in 0..n {
                    assert_eq!(count(&|row| row[place] == a), rows.len() / n, "{n}");
                }
                for b in (0..n).filter(|b| *b != a) {
                    let behind = count(&|row| row.windows(2).any(|pair| pair == [a, b]));
                    assert_eq!(behind, rows.len() / n, "{n}: {b} behind {a}");
                }
            }
        }
    }

    #[test]
    fn the_other_orders() {
        assert_eq!(Order::Listed.rows(3), [[0, 1, 2]]);
        assert_eq!(Order::LatinSquare.rows(3), [[0, 1, 2], [1, 2, 0], [2, 0, 1]]);
    }
}
