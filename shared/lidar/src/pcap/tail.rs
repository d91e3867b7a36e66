//! The time of the last packet of a capture, without reading the whole file.

use super::PcapError;
use super::blocks::{MAX_FRAME, Next, Records};
use files::regular_file;
use geometry::Stamp;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Bytes at the end of a file that are searched: two of the longest frames.
const WINDOW: u64 = 2 * MAX_FRAME as u64;
/// Records that must follow each other, so that no payload is mistaken for a header.
const CHAIN: u32 = 4;
/// Longest time between two records that follow each other, ns.
const MAX_STEP_NANOS: u64 = 3_600_000_000_000;

/// Capture time of the last complete record; `None` if the end of the file is damaged. Of a classic pcap, only the end is read;
/// blocks of pcapng refer to earlier blocks, so it is read as a whole.
pub fn last_stamp(path: &Path) -> Result<Option<Stamp>, PcapError> {
    let mut records = Records::open(path)?;
    let io = |cause| PcapError::Io { path: path.to_owned(), cause };
    let mut file = regular_file::open(path).map_err(io)?;
    let size = file.metadata().map_err(io)?.len();
    let classic = records.classic().filter(|_| size > records.offset() + WINDOW);
    let Some((big_endian, fraction_nanos)) = classic else {
        let mut last = None;
        while let Ok(Next::Record(record)) = records.next() {
            last = Some(record.stamp);
        }
        return Ok(last);
    };
    file.seek(SeekFrom::Start(size - WINDOW)).map_err(io)?;
    let mut bytes = Vec::new();
    file.take(WINDOW).read_to_end(&mut bytes).map_err(io)?;
    Ok(Headers { bytes: &bytes, big_endian, fraction_nanos }.last())
}

/// The end of a classic capture.
struct Headers<'a> {
    bytes: &'a [u8],
    big_endian: bool,
    fraction_nanos: i64,
}

/// Records that follow each other up to the end of the file.
#[derive(Clone, Copy)]
struct Chain {
    n_records: u32,
    /// Stamps of the first and of the last record.
    first: Stamp,
    last: Stamp,
}

impl Headers<'_> {
    /// The stamp of the last complete record of the longest chain.
    fn last(&self) -> Option<Stamp> {
        // Runs from the end to the start, so that every byte is examined once, whatever the file contains.
        let mut chains: Vec<Option<Chain>> = vec![None; self.bytes.len()];
        for at in (0..self.bytes.len()).rev() {
            chains[at] = self.chain(at, &chains);
        }
        let longest = chains.into_iter().flatten().max_by_key(|chain| chain.n_records);
        longest.filter(|chain| chain.n_records >= CHAIN).map(|chain| chain.last)
    }

    /// The chain that begins at a byte.
    fn chain(&self, at: usize, later: &[Option<Chain>]) -> Option<Chain> {
        let header = self.bytes[at..].first_chunk::<16>()?;
        let [seconds, fraction, captured, wire] = [0, 4, 8, 12].map(|k| self.u32_at(header, k));
        let fraction = i64::from(fraction) * self.fraction_nanos;
        // Four bytes later, the same length also appears twice, but is followed by the start of the frame, which is not a
        // length.
        if captured == 0 || captured > wire || wire > MAX_FRAME || fraction >= 1_000_000_000 {
            return None;
        }
        let stamp = Stamp(i64::from(seconds) * 1_000_000_000 + fraction);
        let end = at + 16 + captured as usize;
        let alone = Chain { n_records: 1, first: stamp, last: stamp };
        // After the last complete record, the header of a cut one is incomplete or points beyond the end.
        let Some(header) = self.bytes.get(end..).and_then(|rest| rest.first_chunk::<16>()) else {
            return (end <= self.bytes.len()).then_some(alone);
        };
        let is_cut = end + 16 + self.u32_at(header, 8).min(MAX_FRAME) as usize > self.bytes.len();
        match later[end] {
            Some(next) if next.first.0.abs_diff(stamp.0) <= MAX_STEP_NANOS => {
                Some(Chain { n_records: next.n_records + 1, first: stamp, last: next.last })
            }
            None if is_cut => Some(alone),
            _ => None,
        }
    }

    fn u32_at(&self, header: &[u8; 16], at: usize) -> u32 {
        let word = [header[at], header[at + 1], header[at + 2], header[at + 3]];
        if self.big_endian { u32::from_be_bytes(word) } else { u32::from_le_bytes(word) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pcap::Writer;

    /// A capture of `n` packets, a millisecond apart, whose payload looks like headers of records.
    fn capture(n: i64) -> Vec<u8> {
        let mut writer = Writer::new(Vec::new()).expect("writes");
        let payload: Vec<u8> = (0..300_u32).flat_map(|_| 64_u32.to_le_bytes()).collect();
        for k in 0..n {
            writer.write_udp(Stamp(1_700_000_000_000_000_000 + k * 1_000_000), 2368, &payload).expect("writes");
        }
        writer.finish().expect("finishes")
    }

    #[test]
    fn last_stamp_of_short_long_and_cut_captures_is_that_of_the_last_record() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.pcap");
        for n in [1, 5, 5000] {
            let bytes = capture(n);
            assert_eq!(n == 5000, bytes.len() as u64 > WINDOW + 24);
            std::fs::write(&path, &bytes).expect("writes");
            let stamp = |k: i64| Some(Stamp(1_700_000_000_000_000_000 + k * 1_000_000));
            assert_eq!(last_stamp(&path).expect("reads"), stamp(n - 1), "{n} packets");
            if n > 1 {
                std::fs::write(&path, &bytes[..bytes.len() - 7]).expect("writes");
                assert_eq!(last_stamp(&path).expect("reads"), stamp(n - 2), "{n} packets, cut");
            }
        }
        // The end is something else.
        let mut bytes = capture(5000);
        let end = bytes.len();
        bytes[end - 3_000_000..].fill(0xff);
        std::fs::write(&path, &bytes).expect("writes");
        assert_eq!(last_stamp(&path).expect("reads"), None);
    }
}
