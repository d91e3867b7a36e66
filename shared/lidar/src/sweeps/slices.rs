//! Returns between two times, independent of the encoder: the sweeps of a second LiDAR, cut at the sweep boundaries of
//! the first.

use super::{SweepError, SweepReader};
use crate::revolutions::MAX_RETURNS;
use geometry::Stamp;
use messages::SweepPoint;
use std::net::SocketAddrV4;

/// The returns of a LiDAR between two times.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SliceInfo {
    /// Time of the first firing, with or without a return; `None` without a firing.
    pub stamp: Option<Stamp>,
    /// Number of returns.
    pub n_returns: usize,
    /// Returns before the start, or beyond the largest number of returns; not passed on.
    pub n_skipped: u64,
    /// Data packets lost before the last firing.
    pub lost_packets: u64,
    /// Whether the points have times.
    pub has_times: bool,
}

/// Result of [`SweepReader::poll_slice`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SlicePoll {
    /// All returns up to the end were passed on.
    Complete(SliceInfo),
    /// Not all packets up to the end are written yet. The next call continues the same slice.
    Pending,
    /// The recording ended before the slice.
    End,
}

impl SweepReader {
    /// Passes the returns from `begin` to before `end` (ns since the epoch) to `sink`, in firing order, at most 4096 at a time and at most
    /// [`SweepReader::MAX_RETURNS`] in all. Blocks are not divided. Times of the returns count from the stamp of the
    /// slice. Slices must follow each other and must not be mixed with [`SweepReader::poll_sweep`].
    pub fn poll_slice(
        &mut self,
        [begin, end]: [i64; 2],
        mut sink: impl FnMut(&[SweepPoint]),
    ) -> Result<SlicePoll, SweepError> {
        let mut slice = self.slice.take().unwrap_or(SliceInfo { has_times: true, ..SliceInfo::default() });
        loop {
            if self.at.packet.is_none_or(|place| place.block >= self.blocks.len()) {
                match self.next_packet()? {
                    Some(n_lost) => self.lost_packets += n_lost,
                    None if !self.at.ended => {
                        self.slice = Some(slice);
                        return Ok(SlicePoll::Pending);
                    }
                    None if slice.stamp.is_none() && slice.n_skipped == 0 => return Ok(SlicePoll::End),
                    None => break,
                }
            }
            if self.take_until(begin, end, &mut slice, &mut sink) {
                break;
            }
        }
        slice.lost_packets = std::mem::take(&mut self.lost_packets);
        // Only the first LiDAR provides fixes.
        self.fixes.clear();
        Ok(SlicePoll::Complete(slice))
    }

    /// Ends an incomplete slice without its missing packets. The next slice skips these packets if they arrive.
    pub fn take_slice(&mut self) -> Option<SliceInfo> {
        let slice = self.slice.take()?;
        Some(SliceInfo { lost_packets: std::mem::take(&mut self.lost_packets), ..slice })
    }

    /// Assigns the packets that this sender (address and port) sends to this port to another LiDAR of the drive. They are
    /// neither read nor counted. Nothing changes if this LiDAR has the same addresses, which is common with a separate
    /// capture for each LiDAR.
    pub fn leave_to_other(&mut self, sender: SocketAddrV4, port: u16) {
        if (sender, port) != self.origin() {
            self.others.push((sender, port));
        }
    }

    /// Address and port from which the sensor sends its data packets, and the port to which it sends them.
    pub fn origin(&self) -> (SocketAddrV4, u16) {
        (self.sensor, self.port)
    }

    /// Adds the next blocks of the packet that are before `end`. `true` if a block is at or after `end`.
    fn take_until(
        &mut self,
        begin: i64,
        end: i64,
        slice: &mut SliceInfo,
        sink: &mut impl FnMut(&[SweepPoint]),
    ) -> bool {
        let Some(place) = self.at.packet.as_mut() else { return false };
        let time_of = |block: usize| self.blocks.get(block).map(|(nanos, _)| place.stamp.0 + nanos);
        let from = place.block;
        let n_blocks = self.blocks.len();
        let next_from = |from: usize, nanos: i64| {
            (from..n_blocks).find(|&block| time_of(block).is_some_and(|at| at >= nanos)).unwrap_or(n_blocks)
        };
        let first = next_from(from, begin);
        let last = next_from(first, end);
        let at = (first..last).find_map(time_of);
        place.block = last;
        let packet_stamp = place.stamp;
        if first > from {
            self.decoder.decode(&self.bytes, from..first, 0, &mut self.scratch);
            slice.n_skipped += self.scratch.len as u64;
        }
        let Some(stamp) = slice.stamp.or(at.map(Stamp)) else { return last < n_blocks };
        slice.stamp = Some(stamp);
        self.decoder.decode(&self.bytes, first..last, packet_stamp.0 - stamp.0, &mut self.scratch);
        if slice.n_returns > MAX_RETURNS {
            slice.n_skipped += self.scratch.len as u64;
        } else {
            slice.n_returns += self.scratch.len;
            sink(self.scratch.returns());
        }
        last < n_blocks
    }
}
