fn main() {
    let a: Vec<String> = std::env::args().collect();
    let spec = simulation::DriveSpec::urban(a[1].parse().unwrap(), a[2].parse().unwrap());
    let t = std::time::Instant::now();
    let mut last = 0;
    let r = simulation::write_drive(&spec, std::path::Path::new(&a[3]), &mut |p| {
        if (p * 10.0) as i32 > last {
            last = (p * 10.0) as i32;
            eprintln!("{p:.2} {:.1}", t.elapsed().as_secs_f64());
        }
    })
    .unwrap();
    eprintln!("{:?} {:.1} s", r, t.elapsed().as_secs_f64());
    for (c, s) in r.class_rates() {
        println!("{} {:.3}", c.name(), s * 100.0);
    }
}
