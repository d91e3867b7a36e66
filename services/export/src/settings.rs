//! Settings of export.

use formats::ply::Kind;
use stage::{Rule, list_of_words, one_word};

/// Rule for the topics of classes: unique names, so that no two columns have the same name.
struct ClassTopics;

impl Rule<Vec<String>> for ClassTopics {
    fn allows(&self, topics: &Vec<String>) -> bool {
        let is_further = |topic: &String| topic.len() > "class_".len() && topic.starts_with("class_");
        topics.iter().enumerate().all(|(i, topic)| is_further(topic) && !topics[..i].contains(topic))
    }
    fn text(&self) -> String {
        "must be a list of unique names that start with class_".to_owned()
    }
}

stage::words! {
    /// File formats of clouds.
    pub enum CloudFormat {
        /// PLY, binary, one file for each submap.
        Ply = "ply",
    }
}

stage::words! {
    /// Frames of the clouds.
    pub enum Frame {
        /// Local east-north-up if the drive has GNSS, corrected at the end of the drive.
        World = "world",
        /// Frame of the odometry, never corrected.
        Odom = "odom",
        /// Easting and northing.
        Utm = "utm",
    }
}

stage::words! {
    /// Types of the coordinates in clouds.
    pub enum Coordinates {
        /// 32 bits: 1 mm up to 8 km from the origin.
        Float = "float",
        /// 64 bits.
        Double = "double",
    }
}

impl Coordinates {
    /// The type in a cloud.
    pub(crate) fn kind(self) -> Kind {
        match self {
            Self::Float => Kind::Float,
            Self::Double => Kind::Double,
        }
    }
}

stage::words! {
    /// File formats of the trajectory.
    pub enum TrajectoryFormat {
        /// `trajectory.txt`: stamp, position, quaternion.
        Tum = "tum",
        /// `trajectory_kitti.txt`: matrices of three rows.
        Kitti = "kitti",
        /// `trajectory.csv`, with a header line.
        Csv = "csv",
    }
}

stage::settings! {
    /// Settings of export.
    pub struct Settings {
        /// File formats of the clouds.
        pub formats: Vec<CloudFormat> = vec![CloudFormat::Ply] => list_of_words();
        /// Frame of the clouds: world (local east-north-up if the drive has GNSS, corrected at the end of the drive), odom
        /// (frame of the odometry, never corrected), utm (easting and northing; needs coordinates = "double").
        pub frame: Frame = Frame::World => one_word();
        /// Type of the coordinates in clouds. float resolves 1 mm up to 8 km from the origin.
        pub coordinates: Coordinates = Coordinates::Float => one_word();
        /// Topics of further segmenters, such as `class_b`: each becomes the columns `class_b` and `class_b_score` of
        /// the clouds. Names start with `class_`.
        pub further_classes: Vec<String> = Vec::new() => ClassTopics;
        /// Whether a separate cloud with the spectra is written for each submap.
        pub spectra: bool = true => stage::any();
        /// File formats of the trajectory.
        pub trajectory: Vec<TrajectoryFormat> = vec![TrajectoryFormat::Tum] => list_of_words();
        /// Standard deviation of the horizontal position of a submap above which a georeferenced result is doubtful, m.
        /// A receiver under the open sky has errors of 1 to 3 m; 5 m are the width of a lane and a half.
        pub max_position_deviation_m: f64 = 5.0 => stage::within(0.001, 1e6);
        /// Standard deviation of the height of a submap above which a georeferenced result is doubtful, m. Satellites
        /// are all above the receiver, so heights are about twice as uncertain.
        pub max_height_deviation_m: f64 = 10.0 => stage::within(0.001, 1e6);
        /// Standard deviation of the heading of a submap above which a georeferenced result is doubtful, degrees; 180
        /// accepts any. 5 degrees move a point at 20 m by 1.7 m. Coordinates in UTM are refused beyond this limit: the
        /// clouds stay in the local frame, and the run fails.
        pub max_heading_deviation_deg: f64 = 5.0 => stage::within(0.001, 180.0);
        /// Share of columns lost in live mode above which the result is doubtful. Points without their column look like points
        /// without a class or color, so every lost column is reported.
        pub max_lost_columns_share: f64 = 0.0 => stage::within(0.0, 1.0);
    }
}
