//! The returns of a LiDAR between two times, from captures or from cloud files.

use super::SweepSource;
use super::sweeps::Clouds;
use geometry::Stamp;
use lidar::{SliceInfo, SlicePoll, SweepError, SweepPoint, SweepReader};

impl SweepSource {
    /// Passes the returns from `begin` to before `end` (ns since the epoch) to `sink`, in firing order, in pieces, at most
    /// [`SweepReader::MAX_RETURNS`] in all. Times of the returns count from the stamp of the slice; clouds without times
    /// belong to the slice of their stamp. `None` if the recording ended earlier.
    pub fn next_slice(
        &mut self,
        window: [i64; 2],
        sink: impl FnMut(&[SweepPoint]),
    ) -> Result<Option<SliceInfo>, SweepError> {
        match self {
            Self::Packets { reader, .. } => Ok(match reader.poll_slice(window, sink)? {
                SlicePoll::Complete(info) => Some(info),
                SlicePoll::Pending | SlicePoll::End => None,
            }),
            Self::Clouds(clouds) => Ok(clouds.next_slice(window, sink)),
        }
    }

    /// Informs the readers of captures which packets belong to the other LiDARs of the drive.
    pub fn separate<'a>(sources: impl IntoIterator<Item = &'a mut Self>) {
        let mut sources: Vec<&mut Self> = sources.into_iter().collect();
        let origin = |source: &&mut Self| match source {
            Self::Packets { reader, .. } => Some(reader.origin()),
            Self::Clouds(_) => None,
        };
        let origins: Vec<_> = sources.iter().map(origin).collect();
        for (index, source) in sources.iter_mut().enumerate() {
            let Self::Packets { reader, .. } = source else { continue };
            let others = origins.iter().enumerate().filter(|(other, _)| *other != index);
            others.filter_map(|(_, origin)| *origin).for_each(|(sender, port)| reader.leave_to_other(sender, port));
        }
    }
}

impl Clouds {
    fn next_slice(&mut self, [begin, end]: [i64; 2], mut sink: impl FnMut(&[SweepPoint])) -> Option<SliceInfo> {
        let mut slice = SliceInfo::default();
        let mut is_over = true;
        while let Some(&stamp) = self.stamps.get(self.next) {
            if stamp.0 >= end {
                is_over = false;
                break;
            }
            let Some(cloud) = self.current.take().or_else(|| self.load().map(|loaded| loaded.cloud)) else {
                self.next += 1;
                self.taken = 0;
                continue;
            };
            is_over = false;
            slice.has_times = cloud.has_times;
            // Time of the shot; for clouds without times, the stamp.
            let time_of = |point: &SweepPoint| stamp.0.saturating_add(i64::from(point.offset_nanos));
            let index_of = |nanos: i64| cloud.returns.partition_point(|point| time_of(point) < nanos);
            // A saved position may refer to a file that has changed.
            let taken = self.taken.min(cloud.returns.len());
            let first = taken.max(index_of(begin));
            let last = first.max(index_of(end));
            slice.n_skipped += (first - taken) as u64;
            let is_whole = last == cloud.returns.len();
            let mut points = cloud.returns[first..last].to_vec();
            if let Some(point) = points.first() {
                let at = slice.stamp.get_or_insert(Stamp(time_of(point))).0;
                for point in &mut points {
                    point.offset_nanos = time_of(point).saturating_sub(at).max(0) as u32;
                }
            }
            let room = SweepReader::MAX_RETURNS - slice.n_returns;
            slice.n_skipped += points.len().saturating_sub(room) as u64;
            points.truncate(room);
            slice.n_returns += points.len();
            sink(&points);
            if !is_whole {
                self.taken = last;
                self.current = Some(cloud);
                break;
            }
            self.next += 1;
            self.taken = 0;
        }
        (!is_over).then_some(slice)
    }
}
