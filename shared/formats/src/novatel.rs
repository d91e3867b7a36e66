//! Logs of `NovAtel` OEM7 receivers with an inertial unit (OEM7 Commands and Logs Reference Manual v26): INSPVA, INSPVAS,
//! INSPVAX, as text (`#INSPVAA`, `%INSPVASA`, `#INSPVAXA`) and binary. Other messages and bytes between messages are
//! skipped.
//!
//! Axes of the body: x right, y forward, z up. Azimuth clockwise from north, pitch nose up, roll right side down; degrees.
//! Times are GPS weeks and seconds. Heights of INSPVA and INSPVAS are above the ellipsoid. INSPVAX has heights above mean
//! sea level, to which the reader adds the undulation.

mod binary;
mod crc;
mod text;

/// A pose of the inertial solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NovatelPose {
    /// GPS week.
    pub week: u32,
    /// Seconds of the week.
    pub second: f64,
    /// Latitude, degrees.
    pub latitude_deg: f64,
    /// Longitude, degrees.
    pub longitude_deg: f64,
    /// Height above the ellipsoid, m.
    pub altitude_m: f64,
    /// Roll, degrees.
    pub roll_deg: f64,
    /// Pitch, degrees.
    pub pitch_deg: f64,
    /// Azimuth, degrees.
    pub azimuth_deg: f64,
}

/// Standard deviations of a pose, from INSPVAX.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NovatelDeviation {
    /// GPS week.
    pub week: u32,
    /// Seconds of the week.
    pub second: f64,
    /// Along north, east and up, m.
    pub north_east_up_m: [f64; 3],
    /// Roll, pitch and azimuth, degrees.
    pub roll_pitch_azimuth_deg: [f64; 3],
}

/// Content of a log.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NovatelLog {
    /// Poses of INSPVA and INSPVAS; without any, of INSPVAX.
    pub poses: Vec<NovatelPose>,
    /// Deviations of INSPVAX.
    pub deviations: Vec<NovatelDeviation>,
    /// Messages with a wrong checksum or length.
    pub n_damaged: usize,
    /// Poses of a solution that is not ready: inactive, aligning, determining orientation.
    pub n_not_ready: usize,
    /// Other messages.
    pub n_other: usize,
}

/// Solution status: names in text, numbers in binary logs.
const READY: [(&str, u32); 4] =
    [("INS_HIGH_VARIANCE", 2), ("INS_SOLUTION_GOOD", 3), ("INS_SOLUTION_FREE", 6), ("INS_ALIGNMENT_COMPLETE", 7)];

/// A decoded message.
enum Message {
    /// INSPVA or INSPVAS.
    Pose { pose: NovatelPose, is_ready: bool },
    /// INSPVAX.
    Extended { pose: NovatelPose, deviation: NovatelDeviation, is_ready: bool },
    /// A message of another kind.
    Other,
    /// A message of one of these kinds with a wrong checksum, length or number.
    Damaged,
}

impl NovatelPose {
    /// `numbers`: latitude, longitude, height, three velocities, roll, pitch, azimuth.
    fn new(week: u32, second: f64, numbers: [f64; 9], undulation_m: f64) -> Option<Self> {
        let [latitude_deg, longitude_deg, height_m, _, _, _, roll_deg, pitch_deg, azimuth_deg] = numbers;
        let is_sound = numbers.iter().chain([&second, &undulation_m]).all(|value| value.is_finite());
        let altitude_m = height_m + undulation_m;
        let pose = Self { week, second, latitude_deg, longitude_deg, altitude_m, roll_deg, pitch_deg, azimuth_deg };
        is_sound.then_some(pose)
    }
}

impl NovatelDeviation {
    /// `numbers`: sigmas of latitude, longitude, height, three velocities, roll, pitch, azimuth.
    fn new(week: u32, second: f64, numbers: [f64; 9]) -> Self {
        let [north, east, up, _, _, _, roll, pitch, azimuth] = numbers;
        Self { week, second, north_east_up_m: [north, east, up], roll_pitch_azimuth_deg: [roll, pitch, azimuth] }
    }
}

impl NovatelLog {
    /// Reads a log of text, binary messages, or both.
    pub fn from_bytes(bytes: &[u8]) -> Self {
        let mut log = Self::default();
        let mut extended = Vec::new();
        let mut at = 0;
        while at < bytes.len() {
            let rest = &bytes[at..];
            let found = match rest[0] {
                0xAA => binary::message(rest),
                b'#' | b'%' => text::message(rest),
                _ => None,
            };
            let Some((message, length)) = found else {
                at += 1;
                continue;
            };
            at += length;
            match message {
                Message::Pose { pose, is_ready: true } => log.poses.push(pose),
                Message::Extended { pose, deviation, is_ready: true } => {
                    extended.push(pose);
                    log.deviations.push(deviation);
                }
                Message::Pose { .. } | Message::Extended { .. } => log.n_not_ready += 1,
                Message::Other => log.n_other += 1,
                Message::Damaged => log.n_damaged += 1,
            }
        }
        if log.poses.is_empty() {
            log.poses = extended;
        }
        log
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "INSPVASA,2100,600118.400;2100,600118.400000000,51.15044262019306,-114.0306603499871,\
                        1080.7653169166297,0.0020,-0.0029,0.0030,-0.8826,-0.6894,196.2985,INS_ALIGNMENT_COMPLETE";

    #[test]
    fn text_logs_are_read_and_damaged_lines_are_counted() {
        let line = |text: &str| format!("%{text}*{:08x}\r\n", crc::crc32(text.as_bytes()));
        let extended = "INSPVAXA,COM1,0,73.5,FINESTEERING,1695,309428.000,02000040,4e77,43562;INS_SOLUTION_GOOD,INS_PSRSP,\
                        51.1,-114.0,1063.6,-16.9,0.0,0.0,0.0,1.0,2.0,120.0,0.1,0.2,0.3,0.01,0.01,0.01,0.5,0.6,0.7,3,0";
        let aligning = TEXT.replace("ALIGNMENT_COMPLETE", "ALIGNING");
        let text = [
            "[COM1]<OK\r\n",
            &line(TEXT),
            &line(TEXT).replace("51.15", "51.16"),
            &line(&aligning),
            &format!("#{extended}*{:08x}\n", crc::crc32(extended.as_bytes())),
            &line("BESTPOSA,2100,1.0;SOL_COMPUTED"),
        ]
        .concat();
        let log = NovatelLog::from_bytes(text.as_bytes());
        assert_eq!((log.poses.len(), log.n_damaged, log.n_not_ready, log.n_other), (1, 1, 1, 1));
        assert_eq!((log.poses[0].week, log.poses[0].second), (2100, 600_118.4));
        assert_eq!((log.poses[0].altitude_m, log.poses[0].azimuth_deg), (1_080.765_316_916_629_7, 196.2985));
        let [deviation] = log.deviations[..] else { panic!("{log:?}") };
        assert_eq!(deviation.second, 309_428.0);
        assert_eq!(deviation.north_east_up_m, [0.1, 0.2, 0.3]);
        assert_eq!(deviation.roll_pitch_azimuth_deg, [0.5, 0.6, 0.7]);
    }

    /// The expected numbers were decoded by a Python script by the layout of the manual.
    #[real_data::test("trajectories/novatel_oem7/ins2.gps")]
    fn binary_log_of_a_receiver_has_the_poses_of_its_messages() {
        let bytes = std::fs::read(real_data::path("trajectories/novatel_oem7/ins2.gps")).expect("reads");
        let log = NovatelLog::from_bytes(&bytes);
        assert_eq!((log.poses.len(), log.deviations.len(), log.n_damaged), (62, 6, 0));
        let first = log.poses[0];
        assert_eq!((first.week, first.second), (2100, 600_118.4));
        assert!((first.latitude_deg - 51.150_442_620_193_06).abs() < 1e-13, "{first:?}");
        assert!((first.altitude_m - 1_080.765_316_9).abs() < 1e-6, "{first:?}");
        assert!((first.azimuth_deg - 196.298_545_2).abs() < 1e-6, "{first:?}");
        let mut damaged = bytes.clone();
        damaged[12 + 8..].iter_mut().step_by(997).for_each(|byte| *byte ^= 1);
        let after = NovatelLog::from_bytes(&damaged);
        assert!(after.n_damaged > 0 && after.poses.iter().all(|pose| log.poses.contains(pose)), "{after:?}");
    }

    #[real_data::test("trajectories/novatel_oem7/ins2.gps")]
    fn heights_of_both_kinds_of_messages_are_above_the_ellipsoid() {
        let bytes = std::fs::read(real_data::path("trajectories/novatel_oem7/ins2.gps")).expect("reads");
        let mut extended = Vec::new();
        let mut at = 0;
        while at < bytes.len() {
            match binary::message(&bytes[at..]) {
                Some((message, length)) => {
                    if let Message::Extended { pose, .. } = message {
                        extended.push(pose);
                    }
                    at += length;
                }
                None => at += 1,
            }
        }
        let log = NovatelLog::from_bytes(&bytes);
        assert_eq!(extended.len(), 6);
        for pose in extended {
            let near = log
                .poses
                .iter()
                .min_by(|a, b| (a.second - pose.second).abs().total_cmp(&(b.second - pose.second).abs()));
            let near = near.expect("has poses");
            assert!((near.altitude_m - pose.altitude_m).abs() < 0.1, "{near:?} {pose:?}");
        }
    }
}
