//! Dates of time stamps that count seconds since 1970 (UTC), as Vector's logs write them.
//!
//! The crate `jiff` would replace the arithmetic of [`date`] and [`ms`], 30 lines, with a library larger than this workspace; the
//! texts of [`seconds`], of which recorders write any, it does not read.

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

/// A date with a time of day, or a time of day alone, as seconds since 1970 or since midnight: `2025-11-10 10:00:00.5`,
/// `2025-11-10T10:00Z`, `10.11.2025 10:00:00`, `10:00:00`. None for what is neither.
pub(super) fn seconds(text: &str) -> Option<(f64, Origin)> {
    let number = |text: &str| -> Option<u16> {
        let is_number = text.len() <= 4 && text.bytes().all(|b| b.is_ascii_digit());
        text.parse().ok().filter(|_| is_number)
    };
    let (day, time) = match text.split_once(['T', ' ']) {
        Some((day, time)) => (Some(day), time.trim_start()),
        None => (None, text),
    };
    let (time, zone_min) = match time.strip_suffix('Z') {
        Some(time) => (time, 0),
        None => match time.rfind(['+', '-']) {
            Some(at) => {
                let zone = time[at + 1..].replace(':', "");
                let [hours, minutes] = [
                    zone.get(..2)?,
                    zone.get(2..).filter(|m| !m.is_empty()).unwrap_or("0"),
                ];
                let minutes = i64::from(number(hours)? * 60 + number(minutes)?);
                (
                    &time[..at],
                    if time[at..].starts_with('-') {
                        -minutes
                    } else {
                        minutes
                    },
                )
            }
            None => (time, 0),
        },
    };
    let mut parts = time.trim_end().split(':');
    let [hour, minute] = [number(parts.next()?)?, number(parts.next()?)?];
    let second: f64 = match parts.next() {
        Some(text) if text.starts_with(|c: char| c.is_ascii_digit()) => {
            text.replace(',', ".").parse().ok()?
        }
        Some(_) => return None,
        None => 0.0,
    };
    if parts.next().is_some() || hour > 23 || minute > 59 || !(0.0..61.0).contains(&second) {
        return None;
    }
    let of_day_min = i64::from(hour * 60 + minute) - zone_min;
    let Some(day) = day else {
        return Some((60.0 * of_day_min as f64 + second, Origin::Midnight));
    };
    // A year stands first; where a day stands first, points are between.
    let mut parts: Vec<&str> = day.split(['-', '/', '.']).collect();
    if day.contains('.') && parts.first()?.len() <= 2 {
        parts.reverse();
    }
    let &[year, month, day] = &parts[..] else {
        return None;
    };
    let [year, month, day] = [
        number(year).filter(|_| year.len() == 4)?,
        number(month)?,
        number(day)?,
    ];
    let days_ms = ms([year, month, 0, day, 0, 0, 0, 0])?;
    Some((
        (days_ms / 1000) as f64 + 60.0 * of_day_min as f64 + second,
        Origin::Epoch,
    ))
}

/// Where seconds count from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Origin {
    /// The first of January 1970, UTC.
    Epoch,
    Midnight,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Instants of `date -u -d TEXT +%s`.
    #[test]
    fn dates_as_text_are_those_of_the_calendar() {
        for (text, expected) in [
            ("2025-11-10 10:00:00.010", 1_762_768_800.01),
            ("2025-11-10T10:00Z", 1_762_768_800.0),
            ("2025/11/10 11:30:00+01:30", 1_762_768_800.0),
            ("10.11.2025 05:00:00-0500", 1_762_768_800.0),
            ("2000-02-29T23:59:59,5", 951_868_799.5),
        ] {
            assert_eq!(seconds(text), Some((expected, Origin::Epoch)), "{text}");
        }
        assert_eq!(seconds("10:00:00.25"), Some((36_000.25, Origin::Midnight)));
        for text in [
            "",
            "mark",
            "11/10/2025 10:00:00",
            "2025-13-10 10:00",
            "2025-11-10",
            "1:2:3:4",
            "25:00:00",
            "D:\\x 1",
        ] {
            assert_eq!(seconds(text), None, "{text}");
        }
    }

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
