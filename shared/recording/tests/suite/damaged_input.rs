//! No reader panics or hangs on damaged bytes.

use damage::{attack, seed};
use recording::TickReader;

#[test]
fn damaged_recordings_do_not_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mcap");
    attack(30, 2000, &seed("mcap"), |bytes| {
        std::fs::write(&path, bytes).expect("writes");
        let Ok(mut reader) = TickReader::open(&path, &["class"]) else { return };
        let mut n_ticks = 0;
        while let Ok(Some(_)) = reader.next() {
            n_ticks += 1;
        }
        assert!(n_ticks <= 8);
    });
}

#[test]
fn texts_of_a_recording_longer_than_their_record_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mcap");
    for (opcode, body) in [
        // Schema: id, name. Channel: id, schema, topic. Metadata: name, then a map with a key. Chunk: times, size, sum, compression.
        (3_u8, [&1_u16.to_le_bytes()[..], &u32::MAX.to_le_bytes(), b"x"].concat()),
        (4, [&[1, 0, 1, 0][..], &1_760_000_000_u32.to_le_bytes(), b"x"].concat()),
        (
            12,
            [&1_u32.to_le_bytes()[..], b"r", &8_u32.to_le_bytes(), &3_000_000_000_u32.to_le_bytes(), b"abcd"].concat(),
        ),
        (6, [&[0; 28][..], &3_000_000_000_u32.to_le_bytes(), &[0; 8]].concat()),
    ] {
        let mut bytes = b"\x89MCAP0\r\n".to_vec();
        bytes.extend([&[opcode][..], &(body.len() as u64).to_le_bytes(), &body].concat());
        std::fs::write(&path, &bytes).expect("writes");
        let error = TickReader::open(&path, &["class"]).err().expect("refused").to_string();
        assert!(error.contains("a text of") && error.contains("bytes are left"), "{error}");
    }
}
