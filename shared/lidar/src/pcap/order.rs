//! The order in which captures were recorded, from the times inside. Names only decide where times do not.

use super::blocks::{Format, Next, Records};
use super::{PcapError, last_stamp};
use files::calendar::text_of_nanos;
use files::names::{numbers, sort_by_name};
use files::regular_file;
use geometry::Stamp;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Longest time between the newest and the oldest file of a ring of captures (`tcpdump -W`), ns.
const MAX_SEAM_NANOS: i64 = 2_000_000_000;

/// Whether a file is a capture by its name: not hidden, `*.pcap` or `*.pcapng` in any case, which a number may follow as
/// in `x.pcap1` and `x.pcap.1`.
pub fn is_capture_name(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let Some((_, end)) = name.rsplit_once(".pcap") else { return false };
    let number = end.strip_prefix("ng").unwrap_or(end);
    let number = number.strip_prefix('.').filter(|number| !number.is_empty()).unwrap_or(number);
    !name.starts_with('.') && number.bytes().all(|byte| byte.is_ascii_digit())
}

/// Whether a file begins as a capture.
pub fn has_capture_magic(path: &Path) -> bool {
    let mut begin = [0; 4];
    let read = regular_file::open(path).and_then(|mut file| file.read_exact(&mut begin));
    read.is_ok() && Format::from_magic(begin).is_some()
}

/// A capture and its times.
#[derive(Clone, Debug)]
struct Recorded {
    path: PathBuf,
    first: Stamp,
    last: Stamp,
}

/// Sorts captures by their times. Captures that overlap, of several sensors, are sorted by name in natural order. The error
/// names captures whose numbers contradict their times.
pub fn sort_by_time(files: &mut [PathBuf]) -> Result<(), String> {
    if files.len() < 2 {
        return Ok(());
    }
    sort_by_name(files);
    let mut previous = Stamp(i64::MIN);
    let mut firsts = Vec::new();
    for path in files.iter() {
        // A capture without a readable packet follows the capture before it.
        previous = first_stamp(path).unwrap_or(None).unwrap_or(previous);
        firsts.push(previous);
    }
    if firsts.is_sorted() {
        return Ok(());
    }
    let mut found: Vec<Recorded> = Vec::new();
    for (path, &first) in files.iter().zip(&firsts) {
        let last = last_stamp(path).unwrap_or(None).unwrap_or(first).max(first);
        found.push(Recorded { path: path.clone(), first, last });
    }
    // Is a capture over before one with an earlier name begins?
    let is_wrong = |index: usize| found[index + 1..].iter().any(|later| later.last < found[index].first);
    if !(0..found.len()).any(is_wrong) {
        return Ok(());
    }
    let by_name = found.clone();
    found.sort_by_key(|capture| capture.first);
    check_numbers(&by_name, &found)?;
    for (path, capture) in files.iter_mut().zip(found) {
        *path = capture.path;
    }
    Ok(())
}

/// Capture time of the first record.
fn first_stamp(path: &Path) -> Result<Option<Stamp>, PcapError> {
    Ok(match Records::open(path)?.next()? {
        Next::Record(record) => Some(record.stamp),
        Next::End | Next::Cut => None,
    })
}

/// Fails if captures are counted and their times have another order, unless they are a ring of captures.
fn check_numbers(by_name: &[Recorded], by_time: &[Recorded]) -> Result<(), String> {
    let names: Vec<String> = by_name.iter().map(Recorded::name).collect();
    if numbers(names.iter().map(String::as_str)).is_none() {
        return Ok(());
    }
    let n = by_name.len();
    let oldest = by_name.iter().position(|capture| capture.path == by_time[0].path).unwrap_or(0);
    let is_rotated = (0..n).all(|k| by_name[(oldest + k) % n].path == by_time[k].path);
    let seam = by_name[0].first.0.saturating_sub(by_name[n - 1].last.0);
    if is_rotated && (0..=MAX_SEAM_NANOS).contains(&seam) {
        return Ok(());
    }
    let Some(pair) = by_name.windows(2).find(|pair| pair[1].last < pair[0].first) else { return Ok(()) };
    let [before, after] = [&pair[0], &pair[1]];
    let back_s = (before.last.0.saturating_sub(after.first.0)) as f64 * 1e-9;
    Err(format!(
        "{} has the higher number, but its times are earlier than the times of {}, by {back_s:.3} s: the clock of the recorder was set \
         back, or files were renamed. Process each recording in a folder of its own; if the times are right, name the files in \
         the order of their times",
        after.text(),
        before.text()
    ))
}

impl Recorded {
    fn name(&self) -> String {
        self.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Name, size and times.
    fn text(&self) -> String {
        let size = self.path.metadata().map_or(0, |metadata| metadata.len());
        let [first, last] = [self.first, self.last].map(|stamp| text_of_nanos(stamp.0));
        format!("{} ({size} bytes, {first} to {last})", self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pcap::Writer;

    const BEGIN_S: i64 = 1_700_000_000;

    /// Writes captures of 20 packets each, one per ms; the times of their first packets in ms. Returns their names in order, or the
    /// error.
    fn sorted(captures: &[(&str, i64)]) -> Result<Vec<String>, String> {
        let folder = tempfile::tempdir().expect("a folder");
        let mut files = Vec::new();
        for (name, begin_ms) in captures {
            let mut writer = Writer::new(Vec::new()).expect("writes");
            for k in 0..20 {
                let nanos = BEGIN_S * 1_000_000_000 + (begin_ms + k) * 1_000_000;
                writer.write_udp(Stamp(nanos), 2368, &[7; 100]).expect("writes");
            }
            files.push(folder.path().join(name));
            std::fs::write(folder.path().join(name), writer.finish().expect("finishes")).expect("writes");
        }
        sort_by_time(&mut files)?;
        Ok(files.iter().map(|path| path.file_name().expect("has one").to_string_lossy().into_owned()).collect())
    }

    #[test]
    fn rotated_captures_are_in_the_order_of_their_numbers() {
        for names in [["x.pcap", "x.pcap1", "x.pcap2", "x.pcap10"], ["x_1.pcap", "x_2.pcap", "x_9.pcap", "x_10.pcap"]] {
            let captures: Vec<(&str, i64)> = names.iter().copied().zip([0, 20, 40, 60]).rev().collect();
            assert_eq!(sorted(&captures).expect("are in order"), names);
        }
    }

    #[test]
    fn captures_without_numbers_are_in_the_order_of_their_times() {
        let captures = [("a_second.pcap", 600_000), ("b_first.pcap", 0)];
        assert_eq!(sorted(&captures).expect("sorts"), ["b_first.pcap", "a_second.pcap"]);
    }

    #[test]
    fn ring_of_captures_begins_with_its_oldest_file() {
        let ring = [("x.pcap0", 60), ("x.pcap1", 80), ("x.pcap2", 20), ("x.pcap3", 40)];
        assert_eq!(sorted(&ring).expect("sorts"), ["x.pcap2", "x.pcap3", "x.pcap0", "x.pcap1"]);
    }

    #[test]
    fn captures_that_overlap_are_in_the_order_of_their_names() {
        assert_eq!(sorted(&[("front.pcap", 5), ("rear.pcap", 0)]).expect("sorts"), ["front.pcap", "rear.pcap"]);
    }

    #[test]
    fn numbers_that_contradict_times_are_refused_with_files_sizes_and_times() {
        let error = sorted(&[("x_0.pcap", 600_000), ("x_1.pcap", 0), ("x_2.pcap", 20)]).expect_err("is refused");
        let words = [
            "x_1.pcap (3184 bytes, 2023-11-14 22:13:20.000 UTC to 2023-11-14 22:13:20.019 UTC) has the higher number",
            "earlier than the times of x_0.pcap (3184 bytes, 2023-11-14 22:23:20.000 UTC to",
            "by 600.019 s",
        ];
        assert!(words.iter().all(|words| error.contains(words)), "{error}");
    }

    #[test]
    fn damaged_captures_follow_the_capture_before_them() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut files: Vec<PathBuf> = ["b.pcap", "a.pcap"].iter().map(|name| folder.path().join(name)).collect();
        for path in &files {
            std::fs::write(path, "no capture").expect("writes");
        }
        sort_by_time(&mut files).expect("sorts");
        assert!(files[0].ends_with("a.pcap"));
    }

    #[test]
    fn names_of_captures_may_end_with_a_number() {
        for name in ["a.pcap", "a.PCAP", "a.pcapng", "a.pcap0", "a.pcap12", "a.pcapng3", "a.pcap.1", "a.b.pcap"] {
            assert!(is_capture_name(Path::new(name)), "{name}");
        }
        for name in [".a.pcap", "a.pcapx", "a.pcap.", "a.pcap.gz", "a.pcd", "pcap", "a.pcap1a"] {
            assert!(!is_capture_name(Path::new(name)), "{name}");
        }
    }
}
