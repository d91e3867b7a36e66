//! Lines of a log with their times.

use anyhow::Context;
use files::regular_file;
use geometry::Stamp;
use lidar::nmea::{self, Sentence};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// Longest line that is sent at once, bytes.
const MAX_LINE: u64 = 4096;
const DAY_NANOS: i64 = 86_400_000_000_000;

/// Kind of the lines.
#[derive(Clone, Copy)]
pub(super) enum LineKind {
    Nmea,
    Imu,
}

/// A log, line by line. A line without a time has the time of the previous line, and the first lines have the first time.
pub(super) struct Lines {
    kind: LineKind,
    path: PathBuf,
    reader: BufReader<File>,
    next: Option<(Stamp, String)>,
    last: Option<Stamp>,
}

impl Lines {
    pub(super) fn open(path: &Path, kind: LineKind) -> anyhow::Result<Self> {
        let open = || regular_file::open(path).with_context(|| path.display().to_string());
        let mut lines = Self { kind, path: path.to_owned(), reader: BufReader::new(open()?), next: None, last: None };
        while let (None, Some(line)) = (lines.last, lines.read_line()?) {
            lines.last = lines.stamp_of(&line);
        }
        lines.reader = BufReader::new(open()?);
        lines.advance()?;
        Ok(lines)
    }

    pub(super) fn next_stamp(&self) -> Option<Stamp> {
        self.next.as_ref().map(|(at, _)| *at)
    }

    /// The next line with its end, its stamp moved by `nanos`.
    pub(super) fn moved(&self, nanos: i64) -> Option<String> {
        let (_, line) = self.next.as_ref()?;
        Some(match self.kind {
            _ if nanos == 0 => line.clone(),
            LineKind::Nmea => nmea::restamped(line, nanos),
            LineKind::Imu => moved_sample(line, nanos),
        })
    }

    pub(super) fn advance(&mut self) -> anyhow::Result<()> {
        self.next = match self.read_line()? {
            Some(line) => {
                // A log whose times jump back does not delay the other sensors.
                let stamp = self.stamp_of(&line).max(self.last).unwrap_or(Stamp(0));
                self.last = Some(stamp);
                Some((stamp, line))
            }
            None => None,
        };
        Ok(())
    }

    fn read_line(&mut self) -> anyhow::Result<Option<String>> {
        let mut bytes = Vec::new();
        let read = (&mut self.reader).take(MAX_LINE).read_until(b'\n', &mut bytes);
        let n = read.with_context(|| self.path.display().to_string())?;
        Ok((n > 0).then(|| String::from_utf8_lossy(&bytes).into_owned()))
    }

    fn stamp_of(&self, line: &str) -> Option<Stamp> {
        match self.kind {
            LineKind::Imu => line.split(',').next()?.trim().parse().ok().map(Stamp),
            LineKind::Nmea => match nmea::parse(line).ok()? {
                Sentence::Rmc(rmc) => rmc.stamp,
                Sentence::Zda(zda) => zda.stamp,
                Sentence::Gga(gga) => self.nearest(gga.time_nanos?),
                Sentence::Gst(gst) => self.nearest(gst.time_nanos?),
                Sentence::Gsa(_) | Sentence::Other => None,
            },
        }
    }

    /// The time of day nearest to the last time.
    fn nearest(&self, time_nanos: i64) -> Option<Stamp> {
        let last = self.last?;
        let ahead = (time_nanos - last.0).rem_euclid(DAY_NANOS);
        Some(last.plus_nanos(if ahead > DAY_NANOS / 2 { ahead - DAY_NANOS } else { ahead }))
    }
}

/// A line of the IMU with its stamp moved; the header unchanged.
fn moved_sample(line: &str, nanos: i64) -> String {
    let moved = line.split_once(',').and_then(|(stamp, rest)| Some((stamp.trim().parse::<i64>().ok()?, rest)));
    moved.map_or_else(|| line.to_owned(), |(stamp, rest)| format!("{},{rest}", stamp.saturating_add(nanos)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lidar::nmea::{Fix, gga_from_fix, rmc_from_fix};

    #[test]
    fn lines_have_the_time_of_their_epoch() {
        let folder = tempfile::tempdir().expect("a folder");
        let fix = |second: i64| Fix {
            stamp: Stamp((1_700_000_000 + second) * 1_000_000_000),
            position_deg: [48.0, 2.0],
            altitude_m: Some(100.0),
            speed_mps: None,
            course_deg: None,
            hdop: None,
            satellites: 9,
            quality: 1,
            vdop: None,
            deviation: None,
        };
        let path = folder.path().join("gnss.nmea");
        let first = fix(0);
        let second = fix(1);
        let lines = [
            "noise".to_owned(),
            gga_from_fix(&first, 44.0),
            rmc_from_fix(&first),
            "$GPGSV,1,1,00*79".to_owned(),
            gga_from_fix(&second, 44.0),
        ];
        std::fs::write(&path, lines.join("\r\n")).expect("writes");
        let mut read = Lines::open(&path, LineKind::Nmea).expect("opens");
        for (stamp, line) in [first.stamp; 4].into_iter().chain([second.stamp]).zip(&lines) {
            assert_eq!(read.next_stamp(), Some(stamp), "{line}");
            assert_eq!(read.moved(0).expect("has a line").trim_end(), line);
            read.advance().expect("reads");
        }
        assert!(read.next.is_none());
    }

    #[test]
    fn sample_is_moved_and_the_header_is_not() {
        assert_eq!(moved_sample("12,0,1\r\n", 5), "17,0,1\r\n");
        assert_eq!(moved_sample("stamp,ax\n", 5), "stamp,ax\n");
        assert_eq!(moved_sample("\n", 5), "\n");
    }
}
