//! A real receiver log from an aircraft: 1307 pairs of GGA and RMC among other sentences.

use lidar::nmea;

#[real_data::test("nmea/nmea1.log")]
fn every_fix_of_real_log_is_found_and_agrees_with_its_speed() {
    let path = real_data::path("nmea/nmea1.log");
    let (fixes, stats) = nmea::fixes(&std::fs::read(path).expect("readable"));
    assert_eq!(stats.sentences, 2 * 1307);
    // 314 epochs have status V: the receiver had no position.
    assert_eq!((fixes.len(), stats.without_fix, stats.bad_lines), (993, 314, 0));
    assert!(fixes.is_sorted_by_key(|fix| fix.stamp));

    // Speed over ground is compared with the distance between fixes; the receiver reports both independently.
    // The receiver smooths its speed, so single pairs scatter by a few per cent. Their median does not.
    let mut ratios = Vec::new();
    for pair in fixes.windows(2) {
        let seconds = pair[1].stamp.seconds_since(pair[0].stamp);
        let a = pair[0].position_deg;
        let b = pair[1].position_deg;
        let Some(speed_mps) = pair[1].speed_mps else { continue };
        if speed_mps < 20.0 || seconds > 2.0 {
            continue;
        }
        // Metres per degree on a sphere of the Earth's mean radius; good to half a percent.
        let per_degree_m = 111_195.0;
        let north_m = (b[0] - a[0]) * per_degree_m;
        let east_m = (b[1] - a[1]) * per_degree_m * a[0].to_radians().cos();
        ratios.push(north_m.hypot(east_m) / seconds / speed_mps);
    }
    ratios.sort_by(f64::total_cmp);
    assert!(ratios.len() > 100, "{} pairs of fixes in flight", ratios.len());
    let median = ratios[ratios.len() / 2];
    assert!((0.98..1.02).contains(&median), "distance is {median} times speed times time");
}
