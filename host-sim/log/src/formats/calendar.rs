//! Dates of time stamps that count seconds since 1970 (UTC), as Vector's logs write them.

/// Year, month (1 to 12), weekday (0: Sunday), day, hour, minute, second, millisecond.
pub(super) type Date = [u16; 8];

/// The date of whole milliseconds since 1970; those before it count as 1970.
pub(super) fn date(ms: u64) -> Date {
    let (days, of_day) = (ms / 86_400_000, ms % 86_400_000);
    // Years of 365.2425 days that begin in March, as in the usual algorithm on the proleptic calendar.
    let z = days + 719_468;
    let (era, of_era) = (z / 146_097, z % 146_097);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * from_march + 2) / 5 + 1;
    let month = (from_march + 2) % 12 + 1;
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    let weekday = (days + 4) % 7;
    let parts = [
        year,
        month,
        weekday,
        day,
        of_day / 3_600_000,
        of_day / 60_000 % 60,
        of_day / 1000 % 60,
        of_day % 1000,
    ];
    parts.map(|part| part as u16)
}

/// Milliseconds since 1970 of a date; none if it is no date after 1970.
pub(super) fn ms(date: Date) -> Option<u64> {
    let [year, month, _, day, hour, minute, second, ms] = date.map(u64::from);
    if !(1970..10_000).contains(&year) || !(1..=12).contains(&month) || !(1..=31).contains(&day) || hour > 23
    {
        return None;
    }
    let (y, m) = (year - u64::from(month <= 2), (month + 9) % 12);
    let days = 365 * y + y / 4 - y / 100 + y / 400 + (153 * m + 2) / 5 + day - 1 - 719_468;
    Some(((days * 24 + hour) * 60 + minute) * 60_000 + second * 1000 + ms)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Instants and dates of `date -u`: the epoch, a leap day, the second before a year.
    #[test]
    fn dates_are_those_of_the_calendar() {
        for (seconds, expected) in [
            (0, [1970, 1, 4, 1, 0, 0, 0, 0]),
            (951_782_400, [2000, 2, 2, 29, 0, 0, 0, 0]),
            (1_704_067_199, [2023, 12, 0, 31, 23, 59, 59, 0]),
        ] {
            assert_eq!(date(seconds * 1000), expected);
            assert_eq!(ms(expected), Some(seconds * 1000));
        }
        assert_eq!(ms([0; 8]), None);
    }
}
