//! Doubts about secondary LiDARs.

use super::*;

#[test]
fn doubt_about_a_secondary_lidar_has_its_name_in_name_and_text() {
    let doubt = Doubt::DamagedPackets { share: 0.25, limit: 0.01 };
    let of_rear = Doubt::SecondaryLidar { lidar: "rear".to_owned(), doubt: Box::new(doubt.clone()) };
    assert_eq!((of_rear.kind(), of_rear.size()), (doubt.kind(), 0.25));
    assert_eq!((doubt.name(), of_rear.name()), ("damaged_packets".into(), "damaged_packets_rear".into()));
    assert_eq!(of_rear.to_string(), format!("LiDAR rear: {doubt}"));
}
