use super::*;
use clap::Parser;

fn args(more: &[&str]) -> Args {
    let all = ["x", "--cameras", "/c", "--imu", "127.0.0.1:1", "--nmea", "127.0.0.1:2", "--lidar", "127.0.0.1:3"];
    Args::try_parse_from(all.iter().chain(more)).expect("parses")
}

fn topics(found: &[(&str, &str)]) -> Topics {
    found.iter().map(|(name, kind)| ((*name).to_owned(), (*kind).to_owned())).collect()
}

fn chosen(found: &[(&str, &str)], more: &[&str]) -> (Vec<(String, String)>, String) {
    let ChosenTopics { roles, notes } = choose(&topics(found), &args(more)).expect("chooses");
    (roles.into_iter().map(|(role, topic)| (role.to_string(), topic)).collect(), notes.join("\n"))
}

fn pairs(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
    pairs.iter().map(|(role, topic)| ((*role).to_owned(), (*topic).to_owned())).collect()
}

const IMAGE: &str = "sensor_msgs/Image";
const COMPRESSED: &str = "sensor_msgs/CompressedImage";

#[test]
fn only_topic_of_a_type_gets_its_role() {
    let found = [
        ("/imu/data", "sensor_msgs/Imu"),
        ("/fix", "sensor_msgs/NavSatFix"),
        ("/nmea_sentence", "nmea_msgs/Sentence"),
        ("/velodyne_packets", "velodyne_msgs/VelodyneScan"),
        ("/chatter", "std_msgs/String"),
    ];
    let (roles, notes) = chosen(&found, &[]);
    assert_eq!(roles, pairs(&[("imu", "/imu/data"), ("nmea", "/nmea_sentence"), ("lidar", "/velodyne_packets")]));
    assert_eq!(notes, "/fix: not taken, the receiver's sentences are");
    // A receiver that is named excludes others.
    let (roles, _) = chosen(&found, &["--topic", "gnss=/fix"]);
    assert_eq!(roles, pairs(&[("imu", "/imu/data"), ("lidar", "/velodyne_packets")]));
}

#[test]
fn several_topics_of_a_type_are_refused_until_one_is_named() {
    let found = [("/a/imu", "sensor_msgs/Imu"), ("/b/imu", "sensor_msgs/Imu")];
    let error = choose(&topics(&found), &args(&[])).err().expect("is ambiguous").to_string();
    assert_eq!(error, "several topics can be the imu: /a/imu, /b/imu; --topic imu=TOPIC chooses");
    assert_eq!(chosen(&found, &["--topic", "imu=/b/imu"]).0, []);
}

#[test]
fn each_camera_info_has_one_camera_compressed_before_raw() {
    let found = [
        ("/left/camera_info", CAMERA_INFO),
        ("/left/image_raw", IMAGE),
        ("/left/image_raw/compressed", COMPRESSED),
        ("/right/camera_info", CAMERA_INFO),
        ("/right/image_raw", IMAGE),
        ("/range_image", IMAGE),
    ];
    let (roles, notes) = chosen(&found, &[]);
    assert_eq!(roles, pairs(&[("camera.0", "/left/image_raw/compressed"), ("camera.1", "/right/image_raw")]));
    assert_eq!(
        notes,
        "/range_image: no camera_info in its namespace; --topic camera.0=/range_image takes it\n\
         /left/image_raw: not taken, /left/image_raw/compressed shows the same camera"
    );
    assert_eq!(chosen(&found, &["--topic", "camera.0=/range_image"]).0, []);
}

#[test]
fn packets_of_the_imu_of_an_ouster_are_not_those_of_its_lidar() {
    let packets = "ouster_sensor_msgs/PacketMsg";
    let found = [("/ouster/imu_packets", packets), ("/ouster/lidar_packets", packets)];
    assert_eq!(chosen(&found, &[]).0, pairs(&[("lidar", "/ouster/lidar_packets")]));
}

#[test]
fn clouds_are_refused_with_what_to_do() {
    let (roles, notes) = chosen(&[("/points", "sensor_msgs/PointCloud2")], &[]);
    assert!(roles.is_empty() && notes.contains("/points: sensor_msgs/PointCloud2 is not taken live"), "{notes}");
    let error = Role::Lidar(0).check("/points", "sensor_msgs/PointCloud2").expect_err("is refused").to_string();
    assert!(error.contains("record a bag and import it"), "{error}");
    assert!(Role::Imu.check("/points", "sensor_msgs/PointCloud2").is_err());
    assert!(Role::Mosaic("hs02".into()).check("/hs02", IMAGE).is_ok());
}

#[test]
fn sensors_without_target_are_not_chosen() {
    let args = Args::try_parse_from(["x", "--imu", "127.0.0.1:1"]).expect("parses");
    let found = topics(&[
        ("/fix", "sensor_msgs/NavSatFix"),
        ("/imu", "sensor_msgs/Imu"),
        ("/points", "sensor_msgs/PointCloud2"),
    ]);
    let ChosenTopics { roles, notes } = choose(&found, &args).expect("chooses");
    assert_eq!((roles, notes), (BTreeMap::from([(Role::Imu, "/imu".to_owned())]), Vec::new()));
}
