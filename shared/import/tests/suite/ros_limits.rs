//! Bags that would take more time than their size explains.

use super::support::{folder, import_from, write_file};
use std::io::Write;

/// Content of a chunk that exceeds the limit of a small file, bytes.
const LARGE: usize = 17 << 20;

fn error(bytes: &[u8]) -> String {
    let folder = folder();
    let path = folder.path().join("bag");
    write_file(&path, bytes);
    import_from(&path, &folder).run().expect_err("is refused").to_string()
}

/// Zeros: empty records in all formats.
fn packed_zeros() -> Vec<u8> {
    let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::best());
    encoder.write_all(&vec![0; LARGE]).expect("packs");
    encoder.finish().expect("packs")
}

fn mcap(records: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let magic = b"\x89MCAP0\r\n";
    let end = [(15, vec![0; 4]), (2, vec![0; 20])];
    let record = |(kind, body): &(u8, Vec<u8>)| [&[*kind][..], &(body.len() as u64).to_le_bytes(), body].concat();
    let records: Vec<u8> = records.iter().chain(&end).flat_map(record).collect();
    [&magic[..], &records, magic].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

/// A record of ROS 1.
fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let field = |(name, value): &(&str, &[u8])| {
        let length = (name.len() + 1 + value.len()) as u32;
        [&length.to_le_bytes()[..], name.as_bytes(), b"=", value].concat()
    };
    let header: Vec<u8> = fields.iter().flat_map(field).collect();
    let length = |bytes: &[u8]| (bytes.len() as u32).to_le_bytes();
    [&length(&header)[..], &header, &length(data), data].concat()
}

fn chunk(compression: &str, size: usize, data: &[u8]) -> Vec<u8> {
    let size = (size as u32).to_le_bytes();
    record(&[("op", &[5]), ("compression", compression.as_bytes()), ("size", &size)], data)
}

/// A bag of ROS 1 with these bytes of chunks. `chunks_at`: offsets of the chunks in the bytes.
fn ros1(chunks: &[u8], chunks_at: &[usize]) -> Vec<u8> {
    let head = |index: usize| {
        let index = (index as u64).to_le_bytes();
        [b"#ROSBAG V2.0\n", &record(&[("op", &[3]), ("index_pos", &index)], &[])[..]].concat()
    };
    let begin = head(0).len();
    let kind = b"type=sensor_msgs/PointCloud2";
    let kind = [&(kind.len() as u32).to_le_bytes()[..], kind].concat();
    let connection = record(&[("op", &[7]), ("conn", &[0; 4]), ("topic", b"/points")], &kind);
    let info = |at: &usize| {
        let at = ((begin + at) as u64).to_le_bytes();
        record(&[("op", &[6]), ("chunk_pos", &at), ("start_time", &[0; 8])], &[0, 0, 0, 0, 1, 0, 0, 0])
    };
    let infos: Vec<u8> = chunks_at.iter().flat_map(info).collect();
    [head(begin + chunks.len()), chunks.to_vec(), connection, infos].concat()
}

#[test]
fn chunks_with_more_content_than_their_file_explains_are_refused() {
    let data = packed_zeros();
    assert!(data.len() < 10_000, "{} bytes", data.len());
    let sizes = [&[0; 16][..], &(LARGE as u64).to_le_bytes(), &[0; 4]].concat();
    let body = [sizes, text("bz2"), (data.len() as u64).to_le_bytes().to_vec(), data.clone()].concat();
    let found = error(&mcap(&[(6, body)]));
    assert!(found.contains("byte 8: the chunks up to here contain more than"), "{found}");
    let found = error(&ros1(&chunk("bz2", LARGE, &data), &[0]));
    assert!(found.contains("the chunks up to here contain more than"), "{found}");
}

#[test]
fn chunks_within_chunks_are_refused() {
    let inner = chunk("none", 0, &[]);
    let outer = chunk("none", inner.len(), &inner);
    let inner_at = outer.len() - inner.len();
    let found = error(&ros1(&outer, &[0]));
    assert!(found.contains("/points: no"), "one chunk alone is read: {found}");
    let found = error(&ros1(&outer, &[0, inner_at]));
    assert!(found.contains("a chunk begins here, but the previous one ends at byte"), "{found}");
}

#[test]
fn bags_of_too_many_topics_are_refused() {
    let channel = |id: u16| {
        let body = [&id.to_le_bytes()[..], &[0; 2], &text(&format!("/topic/{id}")), &text("cdr"), &text("")].concat();
        (4, body)
    };
    let channels: Vec<_> = (0..4097).map(channel).collect();
    let found = error(&mcap(&channels));
    assert!(found.ends_with("4097 topics; at most 4096 are read"), "{found}");
    let found = error(&mcap(&channels[1..]));
    assert!(found.contains("no topic with messages of a LiDAR"), "{found}");
}
