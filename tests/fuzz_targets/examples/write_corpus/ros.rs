//! Bags of ROS, and their messages.

use std::io::Write;

/// Seconds of the stamps.
const SECONDS: u32 = 1_700_000_000;
const CDR: bool = true;
const ROS1: bool = false;

/// Writes a message in the order of its fields.
struct Values {
    bytes: Vec<u8>,
    is_cdr: bool,
}

impl Values {
    fn new(is_cdr: bool) -> Self {
        Self { bytes: if is_cdr { vec![0, 1, 0, 0] } else { Vec::new() }, is_cdr }
    }

    /// A number. CDR aligns it to its size.
    fn number<const N: usize>(mut self, bytes: [u8; N]) -> Self {
        while self.is_cdr && !(self.bytes.len() - 4).is_multiple_of(N) {
            self.bytes.push(0);
        }
        self.bytes.extend(bytes);
        self
    }

    fn u8(self, value: u8) -> Self {
        self.number([value])
    }

    fn u32(self, value: u32) -> Self {
        self.number(value.to_le_bytes())
    }

    fn f64s(self, values: &[f64]) -> Self {
        values.iter().fold(self, |to, value| to.number(value.to_le_bytes()))
    }

    fn blob(self, bytes: &[u8]) -> Self {
        let mut to = self.u32(bytes.len() as u32);
        to.bytes.extend(bytes);
        to
    }

    fn text(self, text: &str) -> Self {
        let end = if self.is_cdr { "\0" } else { "" };
        self.blob(format!("{text}{end}").as_bytes())
    }

    fn header(self, nanos: u32, frame: &str) -> Self {
        let to = if self.is_cdr { self } else { self.u32(7) };
        to.u32(SECONDS).u32(nanos).text(frame)
    }
}

/// A cloud of two rows of four points: x y z intensity ring time.
fn cloud(is_cdr: bool, sweep: u32) -> Vec<u8> {
    let fields = [("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("intensity", 12, 7), ("ring", 16, 4), ("time", 18, 7)];
    let head = Values::new(is_cdr).header(sweep * 100_000_000, "velodyne").u32(2).u32(4).u32(fields.len() as u32);
    let head = fields.iter().fold(head, |to, (name, offset, kind)| to.text(name).u32(*offset).u8(*kind).u32(1));
    let mut rows = Vec::new();
    for (ring, column) in (0..8_u16).map(|i| (i / 4, i % 4)) {
        let elevation = f32::from(ring) * 0.1;
        rows.extend([10.0 + f32::from(column), 2.0, 10.0 * elevation, 9.0].map(f32::to_le_bytes).concat());
        rows.extend(ring.to_le_bytes());
        rows.extend((f32::from(column) * 0.02).to_le_bytes());
    }
    head.u8(0).u32(22).u32(88).blob(&rows).u8(1).bytes
}

fn imu(is_cdr: bool) -> Vec<u8> {
    let to = Values::new(is_cdr).header(5, "imu_link").f64s(&[0.0, 0.0, 0.0, 1.0]).f64s(&[0.0; 9]);
    to.f64s(&[0.01, 0.02, 0.03]).f64s(&[0.0; 9]).f64s(&[0.1, 0.2, 9.81]).f64s(&[0.0; 9]).bytes
}

fn fix(is_cdr: bool) -> Vec<u8> {
    let to = Values::new(is_cdr).header(7, "gnss").u8(2).number(1_u16.to_le_bytes());
    to.f64s(&[48.85, 2.35, 104.5]).f64s(&[0.0; 9]).u8(0).bytes
}

fn image(is_cdr: bool) -> Vec<u8> {
    let to = Values::new(is_cdr).header(9, "camera").u32(2).u32(4).text("bayer_rggb8");
    to.u8(0).u32(5).blob(&[7; 10]).bytes
}

fn compressed_image(is_cdr: bool) -> Vec<u8> {
    Values::new(is_cdr)
        .header(9, "camera")
        .text("rgb8; png")
        .blob(&super::seeds::picture(image::ImageFormat::Png))
        .bytes
}

fn camera_info(is_cdr: bool) -> Vec<u8> {
    let to = Values::new(is_cdr).header(9, "camera").u32(2).u32(4).text("plumb_bob").u32(5);
    let to = to.f64s(&[-0.1, 0.02, 0.001, -0.001, 0.0]).f64s(&[8.0, 0.0, 2.0, 0.0, 8.5, 1.0, 0.0, 0.0, 1.0]);
    let to = to.f64s(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    let to = to.f64s(&[7.0, 0.0, 2.0, 0.0, 0.0, 7.5, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    [0; 6].into_iter().fold(to, Values::u32).u8(0).bytes
}

fn tf_static(is_cdr: bool) -> Vec<u8> {
    let one = |to: Values, child: &str, rotation: [f64; 4]| {
        to.header(0, "base_link").text(child).f64s(&[0.5, 0.0, 1.0]).f64s(&rotation)
    };
    let to = one(Values::new(is_cdr).u32(4), "velodyne", [0.0, 0.0, 0.0, 1.0]);
    let to = one(to, "camera", [-0.5, 0.5, -0.5, 0.5]);
    one(one(to, "imu_link", [1.0, 0.0, 0.0, 0.0]), "gnss", [0.0, 0.0, 0.0, 1.0]).bytes
}

fn sentence(is_cdr: bool) -> Vec<u8> {
    let text = "$GPGGA,221320.000,4851.000000,N,00221.000000,E,4,12,0.9,60.0,M,44.5,M,,*6D";
    Values::new(is_cdr).header(3, "gnss").text(text).bytes
}

fn livox(is_cdr: bool) -> Vec<u8> {
    let to = Values::new(is_cdr).header(0, "livox").number(5_u64.to_le_bytes()).u32(3).u8(0).u8(0).u8(0).u8(0).u32(3);
    let point = |to: Values, time: u32| {
        let to = [4.0_f32, 5.0, 6.0].into_iter().fold(to.u32(time), |to, value| to.number(value.to_le_bytes()));
        to.u8(9).u8(0).u8(1)
    };
    [0, 20_000_000, 90_000_000].into_iter().fold(to, point).bytes
}

fn velodyne(is_cdr: bool) -> Vec<u8> {
    let mut to = Values::new(is_cdr).header(0, "velodyne").u32(1).u32(SECONDS).u32(0);
    to.bytes.extend(super::seeds::packet(lidar::velodyne::Model::Vlp16, 3));
    to.bytes
}

fn nebula(is_cdr: bool) -> Vec<u8> {
    let packet = super::seeds::packet(lidar::velodyne::Model::Vlp16, 3);
    Values::new(is_cdr).header(0, "hesai").u32(1).u32(SECONDS).u32(0).blob(&packet).bytes
}

fn ouster(is_cdr: bool) -> [Vec<u8>; 2] {
    let packet = super::seeds::ouster(16, 12, 4, 0);
    [Values::new(is_cdr).blob(&packet).bytes, Values::new(is_cdr).text(super::seeds::METADATA).bytes]
}

/// Inputs of the target `ros_messages`.
pub fn messages() -> Vec<Vec<u8>> {
    let input = |is_cdr: bool, messages: Vec<(u8, Vec<u8>)>| {
        let mut bytes = vec![u8::from(!is_cdr)];
        for (topic, message) in messages {
            bytes.push(topic);
            bytes.extend((message.len() as u16).to_le_bytes());
            bytes.extend(message);
        }
        bytes
    };
    let rig = |is_cdr| {
        let sweeps = [(0, cloud(is_cdr, 0)), (0, cloud(is_cdr, 1))];
        let sensors = [(5, tf_static(is_cdr)), (1, imu(is_cdr)), (2, fix(is_cdr))];
        let cameras = [(4, camera_info(is_cdr)), (3, image(is_cdr)), (7, camera_info(is_cdr))];
        let all = [&sweeps[..], &sensors, &cameras, &[(6, compressed_image(is_cdr))]].concat();
        input(is_cdr, all)
    };
    let [packet, metadata] = ouster(CDR);
    vec![
        rig(CDR),
        rig(ROS1),
        input(CDR, vec![(9, livox(CDR)), (8, sentence(CDR))]),
        input(CDR, vec![(10, velodyne(CDR)), (8, sentence(CDR))]),
        input(CDR, vec![(11, nebula(CDR))]),
        input(CDR, vec![(12, packet), (13, metadata)]),
    ]
}

/// Name, type and message of a small bag.
fn street(is_cdr: bool) -> [(&'static str, &'static str, Vec<u8>); 5] {
    [
        ("/tf_static", "tf2_msgs/msg/TFMessage", tf_static(is_cdr)),
        ("/points", "sensor_msgs/msg/PointCloud2", cloud(is_cdr, 0)),
        ("/points", "sensor_msgs/msg/PointCloud2", cloud(is_cdr, 1)),
        ("/imu", "sensor_msgs/msg/Imu", imu(is_cdr)),
        ("/fix", "sensor_msgs/msg/NavSatFix", fix(is_cdr)),
    ]
}

/// The topics of [`street`] in their order, without duplicates.
fn topics(is_cdr: bool) -> Vec<(&'static str, &'static str)> {
    let mut topics: Vec<(&str, &str)> = street(is_cdr).into_iter().map(|(name, kind, _)| (name, kind)).collect();
    topics.dedup();
    topics
}

fn number_of(topic: &str) -> u32 {
    topics(CDR).iter().position(|(name, _)| *name == topic).expect("is a topic") as u32
}

/// A record of ROS 1: header and data.
fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let field = |(name, value): &(&str, &[u8])| {
        let length = (name.len() + 1 + value.len()) as u32;
        [&length.to_le_bytes()[..], name.as_bytes(), b"=", value].concat()
    };
    let header: Vec<u8> = fields.iter().flat_map(field).collect();
    let length = |bytes: &[u8]| (bytes.len() as u32).to_le_bytes();
    [&length(&header)[..], &header, &length(data), data].concat()
}

/// A bag of ROS 1 with one chunk and this compression.
pub fn ros1_bag(compression: &str) -> Vec<u8> {
    let connection = |(number, (name, kind)): (u32, (&str, &str))| {
        let fields: [(&str, &[u8]); 3] = [("op", &[7]), ("conn", &number.to_le_bytes()), ("topic", name.as_bytes())];
        let kind = kind.replace("/msg/", "/");
        let length = (5 + kind.len()) as u32;
        record(&fields, &[&length.to_le_bytes()[..], b"type=", kind.as_bytes()].concat())
    };
    let connections: Vec<u8> = (0..).zip(topics(ROS1)).flat_map(connection).collect();
    let message = |(topic, _, data): &(&str, &str, Vec<u8>)| {
        let time = [SECONDS.to_le_bytes(), 9_u32.to_le_bytes()].concat();
        record(&[("op", &[2]), ("conn", &number_of(topic).to_le_bytes()), ("time", &time)], data)
    };
    let content = [connections.clone(), street(ROS1).iter().flat_map(message).collect()].concat();
    let packed = match compression {
        "bz2" => {
            let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::best());
            encoder.write_all(&content).expect("packs");
            encoder.finish().expect("packs")
        }
        "lz4" => lz4(&content),
        _ => content.clone(),
    };
    let size = (content.len() as u32).to_le_bytes();
    let chunk = record(&[("op", &[5]), ("compression", compression.as_bytes()), ("size", &size)], &packed);
    let head = |index: u64| {
        let bag = record(&[("op", &[3]), ("index_pos", &index.to_le_bytes()), ("conn_count", &[4, 0, 0, 0])], &[]);
        [b"#ROSBAG V2.0\n", &bag[..]].concat()
    };
    let chunk_at = head(0).len() as u64;
    let counts: Vec<u8> = (0..4_u32).flat_map(|number| [number.to_le_bytes(), 1_u32.to_le_bytes()].concat()).collect();
    let info = record(
        &[("op", &[6]), ("ver", &[1, 0, 0, 0]), ("chunk_pos", &chunk_at.to_le_bytes()), ("start_time", &[0; 8])],
        &counts,
    );
    [head(chunk_at + chunk.len() as u64), chunk, connections, info].concat()
}

fn lz4(content: &[u8]) -> Vec<u8> {
    let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
    encoder.write_all(content).expect("packs");
    encoder.finish().expect("packs")
}

/// An MCAP file with one chunk and this compression, without a summary.
pub fn mcap(compression: &str) -> Vec<u8> {
    let text = |text: &str| [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat();
    let record = |kind: u8, body: &[u8]| [&[kind][..], &(body.len() as u64).to_le_bytes(), body].concat();
    let mut content = Vec::new();
    for (number, (name, kind)) in (0_u16..).zip(topics(CDR)) {
        let id = number.to_le_bytes();
        let schema = (number + 1).to_le_bytes();
        content.extend(record(3, &[&schema[..], &text(kind), &text("ros2msg"), &text("")].concat()));
        content.extend(record(4, &[&id[..], &schema, &text(name), &text("cdr"), &text("")].concat()));
    }
    for (name, _, message) in street(CDR) {
        let time = (u64::from(SECONDS) * 1_000_000_000).to_le_bytes();
        let id = (number_of(name) as u16).to_le_bytes();
        content.extend(record(5, &[&id[..], &[0; 4], &time, &time, &message].concat()));
    }
    let packed = match compression {
        "lz4" => lz4(&content),
        "zstd" => ruzstd::encoding::compress_to_vec(&content[..], ruzstd::encoding::CompressionLevel::Fastest),
        _ => content.clone(),
    };
    let sizes = [&[0; 16][..], &(content.len() as u64).to_le_bytes(), &[0; 4]].concat();
    let chunk = [sizes, text(compression), (packed.len() as u64).to_le_bytes().to_vec(), packed].concat();
    let magic = b"\x89MCAP0\r\n";
    [
        &magic[..],
        &record(1, &[text("ros2"), text("a")].concat()),
        &record(6, &chunk),
        &record(15, &[0; 4]),
        &record(2, &[0; 20]),
        magic,
    ]
    .concat()
}

/// Bytes of a page of [`database`].
const PAGE: usize = 512;

/// A number of a record of `SQLite`.
fn varint(value: usize) -> Vec<u8> {
    if value < 128 { vec![value as u8] } else { vec![0x80 | (value >> 7) as u8, (value & 0x7f) as u8] }
}

/// A leaf of these records, whose ids count from 1. Records that do not fit continue on the pages from `next_page`,
/// which are also returned.
fn leaf(begin: usize, records: &[Vec<u8>], mut next_page: u32) -> (Vec<u8>, Vec<Vec<u8>>) {
    let mut page = vec![0; PAGE];
    let mut others = Vec::new();
    let mut end = PAGE;
    page[begin] = 13;
    page[begin + 3..begin + 5].copy_from_slice(&(records.len() as u16).to_be_bytes());
    for (index, record) in records.iter().enumerate() {
        let mut cell = [varint(record.len()), varint(index + 1)].concat();
        if record.len() <= PAGE - 35 {
            cell.extend(record);
        } else {
            let min = (PAGE - 12) * 32 / 255 - 23;
            let fits = min + (record.len() - min) % (PAGE - 4);
            let (here, mut rest) = record.split_at(if fits <= PAGE - 35 { fits } else { min });
            cell.extend(here);
            cell.extend(next_page.to_be_bytes());
            while !rest.is_empty() {
                let (part, behind) = rest.split_at(rest.len().min(PAGE - 4));
                next_page += 1;
                let link = if behind.is_empty() { 0 } else { next_page };
                let mut other = [&link.to_be_bytes()[..], part].concat();
                other.resize(PAGE, 0);
                others.push(other);
                rest = behind;
            }
        }
        end -= cell.len();
        page[end..end + cell.len()].copy_from_slice(&cell);
        page[begin + 8 + 2 * index..begin + 10 + 2 * index].copy_from_slice(&(end as u16).to_be_bytes());
    }
    (page, others)
}

/// A record of these kinds and values.
fn row(values: &[(usize, &[u8])]) -> Vec<u8> {
    let kinds: Vec<u8> = values.iter().flat_map(|(kind, _)| varint(*kind)).collect();
    let bytes: Vec<u8> = values.iter().flat_map(|(_, bytes)| bytes.to_vec()).collect();
    [varint(kinds.len() + 1), kinds, bytes].concat()
}

/// A ROS 2 bag in a database of `SQLite`: a page for the schema, one for the topics, and one for each message on a tree.
pub fn database() -> Vec<u8> {
    let text = |text: &'static str| (13 + 2 * text.len(), text.as_bytes());
    let table =
        |name: &'static str, root: &'static [u8]| row(&[text("table"), text(name), text(name), (1, root), text("")]);
    let (mut first, _) = leaf(100, &[table("topics", &[2]), table("messages", &[3])], 0);
    let topic = |(name, kind): (&'static str, &'static str)| {
        row(&[(0, &[][..]), text(name), text(kind), text("cdr"), text("")])
    };
    let (second, _) = leaf(0, &topics(CDR).into_iter().map(topic).collect::<Vec<_>>(), 0);
    let messages = street(CDR);
    // An inner page, then a leaf for each message and the rest of its record.
    let mut pages = Vec::new();
    let mut children = Vec::new();
    for (number, (name, _, message)) in (1_u8..).zip(&messages) {
        let id = [number_of(name) as u8 + 1];
        let time = (i64::from(SECONDS) * 1_000_000_000 + i64::from(number)).to_be_bytes();
        let row = row(&[(0, &[]), (1, &id), (6, &time), (12 + 2 * message.len(), message)]);
        let at = 4 + pages.len() as u32;
        children.push(at);
        let (leaf, others) = leaf(0, &[row], at + 1);
        pages.push(leaf);
        pages.extend(others);
    }
    let (last, before) = children.split_last().expect("has messages");
    let mut inner = vec![0; PAGE];
    inner[0] = 5;
    inner[3..5].copy_from_slice(&(before.len() as u16).to_be_bytes());
    inner[8..12].copy_from_slice(&last.to_be_bytes());
    for (index, child) in before.iter().enumerate() {
        let end = PAGE - 5 * (index + 1);
        inner[end..end + 4].copy_from_slice(&child.to_be_bytes());
        inner[end + 4] = index as u8 + 1;
        inner[12 + 2 * index..14 + 2 * index].copy_from_slice(&(end as u16).to_be_bytes());
    }
    first[..16].copy_from_slice(b"SQLite format 3\0");
    first[16..18].copy_from_slice(&(PAGE as u16).to_be_bytes());
    first[28..32].copy_from_slice(&(3 + pages.len() as u32).to_be_bytes());
    first[59] = 1;
    [vec![first, second, inner], pages].concat().concat()
}

/// The description of a bag.
pub const BAG: &str = "rosbag2_bagfile_information:\n  compression_format: ''\n  compression_mode: ''\n  files:\n  - path: a_0.mcap\n\
    \x20 message_count: 21\n  relative_file_paths:\n  - a_0.mcap\n  storage_identifier: mcap\n";
