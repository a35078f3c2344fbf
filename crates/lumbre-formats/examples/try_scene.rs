fn main() {
    for p in std::env::args().skip(1) {
        let o = lumbre_formats::ReadOptions::default();
        let t = std::time::Instant::now();
        match lumbre_formats::open_scene(std::path::Path::new(&p), &o) {
            Ok((s, d)) => {
                println!(
                    "{p}: {} shapes {} materials {} lights {:?} {:?}",
                    s.shapes.len(),
                    s.materials.len(),
                    s.lights.len(),
                    s.film,
                    t.elapsed()
                );
                for l in d.lines() {
                    println!("  {l}");
                }
            }
            Err(e) => println!("{}", e.to_diagnostic()),
        }
    }
}
