#[test]
fn sim() {
    use acquire::{Acquire, Settings};
    use stage::testing::{Bench, context};
    let f = std::path::Path::new("/tmp/simdrive");
    let mut b = Bench::<Acquire>::new(&Settings::default(), &context(f)).unwrap();
    let (mut s, mut i, mut m, mut g, mut u) = (0, 0, 0, 0, 0);
    let t = std::time::Instant::now();
    while b.tick().unwrap() == stage::Flow::Continue {
        s += b.take::<messages::Sweep>().len(); i += b.take::<messages::Image>().len(); m += b.take::<messages::Mosaic>().len();
        g += b.take::<messages::Gnss>().iter().map(|m| m.rows().len()).sum::<usize>(); u += b.take::<messages::Imu>().iter().map(|m| m.rows().len()).sum::<usize>();
    }
    eprintln!("{s} sweeps {i} images {m} mosaics {g} fixes {u} imu; skipped {} {} {:?} {:?}", b.counter("images_skipped_by_trigger"), b.counter("partial_sweeps"), b.notes(), t.elapsed());
}
