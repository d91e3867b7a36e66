use super::*;

const STAMP: i64 = 1_700_000_000_250_000_000;
const RECEIVED: i64 = 1_700_000_001_000_000_000;

/// A message in CDR, little-endian.
struct Message(Vec<u8>);

impl Message {
    /// A message with a header.
    fn at(stamp: i64) -> Self {
        let seconds = stamp / 1_000_000_000;
        let nanos = stamp % 1_000_000_000;
        Self(vec![0, 1, 0, 0]).number((seconds as u32).to_le_bytes()).number((nanos as u32).to_le_bytes()).text("front")
    }

    fn number<const N: usize>(mut self, bytes: [u8; N]) -> Self {
        let n_bytes = (self.0.len() - 4).next_multiple_of(N) + 4;
        self.0.resize(n_bytes, 0);
        self.0.extend(bytes);
        self
    }

    fn u32(self, value: u32) -> Self {
        self.number(value.to_le_bytes())
    }

    fn f64s(self, values: &[f64]) -> Self {
        values.iter().fold(self, |message, value| message.number(value.to_le_bytes()))
    }

    fn text(self, text: &str) -> Self {
        self.blob(&[text.as_bytes(), b"\0"].concat())
    }

    fn blob(self, bytes: &[u8]) -> Self {
        let mut message = self.u32(bytes.len() as u32);
        message.0.extend(bytes);
        message
    }
}

fn image(stamp: i64, encoding: &str, [width, height, step]: [u32; 3], data: &[u8]) -> Vec<u8> {
    let head = Message::at(stamp).u32(height).u32(width).text(encoding);
    head.number([0_u8]).u32(step).blob(data).0
}

fn imu(stamp: i64, down: f64) -> Vec<u8> {
    let message = Message::at(stamp).f64s(&[0.0; 13]).f64s(&[0.1, 0.2, 0.3]).f64s(&[0.0; 9]);
    message.f64s(&[0.0, 0.0, down]).f64s(&[0.0; 9]).0
}

fn topic(name: &str) -> LiveTopic {
    LiveTopic::new(name, false).expect("is taken")
}

fn lines(data: Result<LiveData<'_>, String>) -> Vec<String> {
    match data {
        Ok(LiveData::Lines(lines)) => lines,
        other => panic!("{other:?}"),
    }
}

#[test]
fn compressed_image_keeps_its_bytes_and_raw_image_its_pixels() {
    let bytes = b"\xff\xd8\xff\xe0 an image";
    let message = Message::at(STAMP).text("jpeg").blob(bytes).0;
    let expected = LiveData::Image { stamp: STAMP, extension: "jpg", content: bytes.as_slice().into() };
    assert_eq!(topic("sensor_msgs/CompressedImage").read(&message, RECEIVED), Ok(expected));

    let message = image(STAMP, "bgr8", [2, 1, 8], &[3, 2, 1, 6, 5, 4, 0, 0]);
    let read = topic("sensor_msgs/Image").read(&message, RECEIVED);
    let Ok(LiveData::Image { stamp: STAMP, extension: "png", content }) = read else { panic!("{read:?}") };
    let pixels = image::load_from_memory(&content).expect("decodes").into_rgb8();
    assert_eq!((pixels.dimensions(), pixels.as_raw().as_slice()), ((2, 1), &[1, 2, 3, 4, 5, 6][..]));
}

#[test]
fn image_of_a_mosaic_camera_keeps_its_samples() {
    for (encoding, step, data, samples) in [
        ("mono16", 6, &[1, 2, 3, 4, 9, 9, 5, 6, 7, 8][..], [0x0201, 0x0403, 0x0605, 0x0807]),
        ("bayer_rggb8", 2, &[1, 2, 3, 4], [1, 2, 3, 4]),
    ] {
        let message = image(STAMP, encoding, [2, 2, step], data);
        let mut topic = LiveTopic::new("sensor_msgs/Image", true).expect("is taken");
        let Ok(LiveData::Image { extension: "pgm", content, .. }) = topic.read(&message, RECEIVED) else { panic!() };
        let image = formats::pgm::Pgm::parse(&content).expect("parses");
        assert_eq!(image.samples(), samples, "{encoding}");
    }
    // The maximum of the smallest bit depth, at least nine bits.
    for (largest, max) in [(1000_u16, 1023), (3, 511), (1024, 2047), (65_535, 65_535)] {
        let data = [3_u16.to_le_bytes(), largest.to_le_bytes()].concat();
        let mut topic = LiveTopic::new("sensor_msgs/Image", true).expect("is taken");
        let message = image(STAMP, "16UC1", [2, 1, 4], &data);
        let Ok(LiveData::Image { content, .. }) = topic.read(&message, RECEIVED) else { panic!() };
        let image = formats::pgm::Pgm::parse(&content).expect("parses");
        assert_eq!((image.max, image.samples()), (max, vec![3, largest]));
    }
    let mut mosaic = LiveTopic::new("sensor_msgs/Image", true).expect("is taken");
    let error = mosaic.read(&image(STAMP, "rgb8", [1, 1, 3], &[0; 3]), RECEIVED).map(drop);
    assert!(error.as_ref().is_err_and(|error| error.contains("must be one of mono8")), "{error:?}");
    let mut mosaic = LiveTopic::new("sensor_msgs/CompressedImage", true).expect("is taken");
    let error = mosaic.read(&Message::at(STAMP).text("jpeg").blob(b"\xff\xd8\xff").0, RECEIVED).map(drop);
    assert!(error.is_err_and(|error| error.contains("has lost the samples")));
}

#[test]
fn image_with_the_stamp_of_the_one_before_is_left_out() {
    let mut topic = topic("sensor_msgs/Image");
    let message = image(STAMP, "mono8", [1, 1, 1], &[7]);
    assert!(topic.read(&message, RECEIVED).is_ok());
    assert_eq!(topic.read(&message, RECEIVED), Err("its stamp equals the stamp of the previous image".into()));
}

#[test]
fn message_without_stamp_takes_the_time_of_reception() {
    let mut topic = topic("sensor_msgs/Image");
    let message = image(0, "mono8", [1, 1, 1], &[7]);
    let data = topic.read(&message, RECEIVED);
    assert!(matches!(data, Ok(LiveData::Image { stamp: RECEIVED, .. })), "{data:?}");
    assert_eq!(topic.n_unstamped, 1);
}

#[test]
fn samples_wait_until_their_unit_is_known() {
    for (down, expected) in [(9.75, "9.75"), (1.0, "9.80665")] {
        let mut topic = topic("sensor_msgs/Imu");
        let mut read: Vec<String> = Vec::new();
        for index in 0..12 {
            let stamp = STAMP + index * 5_000_000;
            read.extend(lines(topic.read(&imu(stamp, down), RECEIVED)));
            assert_eq!(read.len() as i64, if index < 9 { 0 } else { index + 1 });
        }
        assert_eq!(read[11], format!("{},0,0,{expected},0.1,0.2,0.3", STAMP + 55_000_000));
        let late = topic.read(&imu(STAMP, down), RECEIVED).map(drop);
        assert_eq!(late, Err("its stamp is not later than the stamp of the previous sample".into()));
        let bad = topic.read(&imu(STAMP + 60_000_000, f64::NAN), RECEIVED).map(drop);
        assert!(bad.is_err_and(|error| error.contains("no values")));
    }
}

#[test]
fn positions_and_sentences_become_lines() {
    let fix = Message::at(STAMP)
        .number([2_u8])
        .number(1_u16.to_le_bytes())
        .f64s(&[48.5, 2.25, 93.5])
        .f64s(&[0.0; 9])
        .number([0_u8]);
    let [gga, rmc] = &lines(topic("sensor_msgs/NavSatFix").read(&fix.0, RECEIVED))[..] else { panic!() };
    assert!(
        gga.starts_with("$GPGGA,221320.250,4830.0000") && rmc.starts_with("$GPRMC,221320.250,A,4830.0000"),
        "{gga} {rmc}"
    );

    let message = |text: &str| Message::at(STAMP).text(text).0;
    let mut topic = topic("nmea_msgs/Sentence");
    assert_eq!(
        lines(topic.read(&message("$GPGGA,1*00\r\n\r\n $GPRMC,2*00\r\n"), RECEIVED)),
        ["$GPGGA,1*00", "$GPRMC,2*00"]
    );
    let error = topic.read(&message(&"x".repeat(2000)), RECEIVED).map(drop);
    assert_eq!(error, Err("a sentence of 2000 bytes; must be at most 1024".into()));
}

#[test]
fn packets_are_those_of_the_sensor() {
    let packet = |seed: u8| vec![seed; 1206];
    let scan = (1..=3).fold(Message::at(STAMP).u32(3), |scan, seed| {
        let mut scan = scan.u32(1_700_000_000).u32(0);
        scan.0.extend(packet(seed));
        scan
    });
    let one = packet(1);
    let two = packet(2);
    let three = packet(3);
    let read = topic("velodyne_msgs/VelodyneScan").read(&scan.0, RECEIVED).map(|data| match data {
        LiveData::Packets(packets) => packets.into_iter().map(<[u8]>::to_vec).collect::<Vec<_>>(),
        other => panic!("{other:?}"),
    });
    assert_eq!(read, Ok(vec![one, two, three]));
    let ouster = [&[0, 1, 0, 0][..], &5_u32.to_le_bytes(), b"bytes"].concat();
    let packets = LiveData::Packets(vec![b"bytes"]);
    assert_eq!(topic("ouster_sensor_msgs/PacketMsg").read(&ouster, RECEIVED), Ok(packets));
}

#[test]
fn cut_messages_are_left_out_and_the_next_is_read() {
    let fix = Message::at(STAMP).number([0_u8]).number(1_u16.to_le_bytes()).f64s(&[48.5, 2.25, 93.5]);
    let fix = fix.f64s(&[4.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 16.0]).number([2_u8]);
    let mut scan = Message::at(STAMP).u32(1).u32(0).u32(0);
    scan.0.extend([0; 1206]);
    for (name, whole) in [
        ("sensor_msgs/Image", image(STAMP, "rgb8", [2, 2, 6], &[1; 12])),
        ("sensor_msgs/CompressedImage", Message::at(STAMP).text("jpeg").blob(b"\xff\xd8\xff").0),
        ("sensor_msgs/Imu", imu(STAMP, 9.8)),
        ("sensor_msgs/NavSatFix", fix.0),
        ("nmea_msgs/Sentence", Message::at(STAMP).text("$GPGGA").0),
        ("velodyne_msgs/VelodyneScan", scan.0),
    ] {
        let mut topic = topic(name);
        // The IMU's last covariances are the last values that are read.
        for n in 0..whole.len() {
            assert!(topic.read(&whole[..n], RECEIVED).is_err(), "{name}: {n} of {} bytes", whole.len());
        }
        assert!(topic.read(&whole, RECEIVED).is_ok(), "{name}");
    }
}

#[test]
fn types_are_those_of_sensors() {
    assert_eq!(LiveSensor::from_type("sensor_msgs/CompressedImage"), Some(LiveSensor::Camera));
    assert_eq!(LiveSensor::from_type("nebula_msgs/NebulaPackets"), Some(LiveSensor::Packets));
    assert_eq!(LiveSensor::from_type("sensor_msgs/PointCloud2"), Some(LiveSensor::Clouds));
    assert_eq!(LiveSensor::from_type("std_msgs/String"), None);
    assert!(LiveTopic::new("sensor_msgs/PointCloud2", false).is_none());
}
