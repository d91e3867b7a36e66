//! Publishing shared by recorded drives and live sensors.

use crate::frames::room;
use formats::drive::SweepInfo;
use formats::nmea::{Fix, LogStats};
use formats::velodyne::{LidarStats, Model};
use messages::{GnssRow, GnssTopic, Message, SweepTopic};
use stage::{Loan, Outputs, StepError};

/// Publishes a sweep whose points are in the loan.
pub(crate) fn publish_sweep(
    mut loan: Loan<SweepTopic>,
    sweep: &SweepInfo,
    model: Model,
    outputs: &mut Outputs,
) -> Result<(), StepError> {
    let header = loan.header_mut();
    header.duration_nanos = sweep.duration_nanos;
    header.lost_packets = sweep.lost_packets.min(u64::from(u32::MAX)) as u32;
    header.n_rings = model.n_rings() as u32;
    header.has_times = u32::from(sweep.has_times);
    outputs.publish(loan, sweep.stamp.0)
}

/// Publishes the fixes that have a height. Returns their number.
pub(crate) fn publish_fixes(fixes: &[Fix], outputs: &mut Outputs) -> Result<u64, StepError> {
    let rows: Vec<GnssRow> = fixes.iter().filter_map(gnss_row).collect();
    let n_without_height = fixes.len() - rows.len();
    if n_without_height > 0 {
        outputs.count("gnss_without_height", n_without_height as u64);
    }
    publish_rows::<GnssTopic>(&rows, rows.first().map(|row| row.stamp), outputs)?;
    Ok(rows.len() as u64)
}

/// Publishes one message with the rows of a tick; none without rows.
pub(crate) fn publish_rows<T: Message>(
    rows: &[T::Row],
    stamp: Option<i64>,
    outputs: &mut Outputs,
) -> Result<(), StepError> {
    let Some(stamp) = stamp else { return Ok(()) };
    let mut loan = outputs.loan::<T>(rows.len())?;
    room(&mut loan, rows.len())?.copy_from_slice(rows);
    outputs.publish(loan, stamp)
}

/// `None` without a height.
fn gnss_row(fix: &Fix) -> Option<GnssRow> {
    Some(GnssRow {
        stamp: fix.stamp.0,
        latitude_deg: fix.position_deg[0],
        longitude_deg: fix.position_deg[1],
        altitude_m: fix.altitude_m?,
        speed_mps: fix.speed_mps.unwrap_or(-1.0),
        course_deg: fix.course_deg.unwrap_or(-1.0),
        hdop: fix.hdop.unwrap_or_default() as f32,
        satellites: fix.satellites,
        quality: fix.quality,
        reserved: 0,
    })
}

/// The counts that are already in the run summary.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ReportedCounts {
    lidar: LidarStats,
    log: LogStats,
}

impl ReportedCounts {
    /// All counts so far.
    pub(crate) fn up_to(lidar: LidarStats, log: LogStats) -> Self {
        Self { lidar, log }
    }

    /// Adds the packets received, lost or damaged since the last call to the run summary.
    pub(crate) fn report(&mut self, lidar: LidarStats, log: LogStats, outputs: &mut Outputs) {
        let mut add = |name, now: u64, before: u64| {
            if now > before {
                outputs.count(name, now - before);
            }
        };
        for ((name, now), (_, before)) in lidar.counts().into_iter().zip(self.lidar.counts()) {
            add(name, now, before);
        }
        add("bad_nmea_lines", log.bad_lines, self.log.bad_lines);
        add("gnss_without_fix", log.without_fix, self.log.without_fix);
        add("gnss_out_of_order", log.out_of_order, self.log.out_of_order);
        (self.lidar, self.log) = (lidar, log);
    }
}
