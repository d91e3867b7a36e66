//! The header `Range` of a request (RFC 9110, section 14).

/// Bytes that a client requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Range {
    /// All bytes. Also used for values that are not a single range of bytes, as the RFC requires.
    Whole,
    /// Bytes from the first to before the second, inside the content.
    Part(u64, u64),
    /// All requested bytes are outside the content.
    Unsatisfiable,
}

impl Range {
    /// The range that the value of the header selects in a content of `n_bytes`.
    pub(crate) fn parse(value: Option<&str>, n_bytes: u64) -> Self {
        let Some((first, last)) = value.and_then(single) else { return Self::Whole };
        let (begin, end) = match (first, last) {
            (Some(first), Some(last)) if last < first => return Self::Whole,
            (Some(first), last) => (first, last.map_or(n_bytes, |last| last.saturating_add(1).min(n_bytes))),
            (None, Some(n_last)) => (n_bytes.saturating_sub(n_last), n_bytes),
            (None, None) => return Self::Whole,
        };
        if begin < end { Self::Part(begin, end) } else { Self::Unsatisfiable }
    }
}

/// Parses `bytes=10-19`, `bytes=10-` or `bytes=-5`. `None` for anything else.
fn single(value: &str) -> Option<(Option<u64>, Option<u64>)> {
    let (unit, range) = value.split_once('=')?;
    let (first, last) = range.trim().split_once('-')?;
    // `parse` would accept a sign.
    let are_digits = first.bytes().chain(last.bytes()).all(|b| b.is_ascii_digit());
    if !unit.trim().eq_ignore_ascii_case("bytes") || !are_digits {
        return None;
    }
    let number = |digits: &str| if digits.is_empty() { Ok(None) } else { digits.parse().map(Some) };
    Some((number(first).ok()?, number(last).ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn range_is_cut_at_the_end_of_the_content() {
        for (value, expected) in [
            ("bytes=0-0", Range::Part(0, 1)),
            ("bytes=2-3", Range::Part(2, 4)),
            ("bytes=2-", Range::Part(2, 10)),
            ("bytes=-3", Range::Part(7, 10)),
            ("bytes=-30", Range::Part(0, 10)),
            ("Bytes=8-99", Range::Part(8, 10)),
            ("bytes=8-18446744073709551615", Range::Part(8, 10)),
            ("bytes=10-", Range::Unsatisfiable),
            ("bytes=-0", Range::Unsatisfiable),
        ] {
            assert_eq!(Range::parse(Some(value), 10), expected, "{value}");
        }
        assert_eq!(Range::parse(Some("bytes=0-"), 0), Range::Unsatisfiable);
    }

    #[test]
    fn what_is_no_single_range_asks_for_the_whole_content() {
        let others =
            ["", "bytes", "bytes=", "bytes=-", "bytes=3-2", "bytes=0-1,4-5", "lines=1-2", "bytes=+1-2", "bytes=a-"];
        for value in others.into_iter().map(Some).chain([None, Some("bytes=99999999999999999999-")]) {
            assert_eq!(Range::parse(value, 10), Range::Whole, "{value:?}");
        }
    }
}
