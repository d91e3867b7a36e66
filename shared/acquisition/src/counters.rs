//! Counters of packets and sentences, reported as differences.

use lidar::LidarStats;
use lidar::nmea::LogStats;

/// The counts that have been reported.
#[derive(Clone, Debug, Default)]
pub struct ReportedCounts {
    lidar: LidarStats,
    log: LogStats,
}

impl ReportedCounts {
    /// All counts so far.
    pub fn up_to(lidar: LidarStats, log: LogStats) -> Self {
        Self { lidar, log }
    }

    /// Names and numbers of packets and sentences received, lost or damaged since the last call.
    pub fn take_new(&mut self, lidar: LidarStats, log: LogStats) -> Vec<(&'static str, u64)> {
        let of_lidar = lidar.counts().into_iter().zip(self.lidar.counts());
        let of_log = [
            ("bad_nmea_lines", log.bad_lines, self.log.bad_lines),
            ("gnss_without_checksum", log.without_checksum, self.log.without_checksum),
            ("gnss_without_fix", log.without_fix, self.log.without_fix),
            ("gnss_at_zero", log.null_islands, self.log.null_islands),
            ("gnss_undated", log.undated, self.log.undated),
            ("gnss_out_of_order", log.out_of_order, self.log.out_of_order),
            ("gnss_repeated", log.repeated, self.log.repeated),
        ];
        let all = of_lidar.map(|((name, now), (_, before))| (name, now, before)).chain(of_log);
        let new = all.filter(|(_, now, before)| now > before).map(|(name, now, before)| (name, now - before)).collect();
        self.lidar = lidar;
        self.log = log;
        new
    }
}
