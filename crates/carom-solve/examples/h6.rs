use carom_solve::problem::{natural, Problem, Scaled};
use carom_solve::Bounds;
use carom_solve::solver::sweep::Sweeps;
use std::time::Instant;
fn main() {
    let mode = std::env::var("MODE").unwrap_or("order".into());
    for path in std::env::args().skip(1) {
        let b = std::fs::read(&path).unwrap();
        let w: Vec<[u8; 8]> = b.chunks_exact(8).map(|c| c.try_into().unwrap()).collect();
        let mut at = 0;
        let mut ints = |n: usize| { let v: Vec<i64> = w[at..at + n].iter().map(|c| i64::from_le_bytes(*c)).collect(); at += n; v };
        let h = ints(3);
        let (d, c, nnz) = (h[0] as usize, h[1] as usize, h[2] as usize);
        let ptr = ints(d * c + 1);
        let col = ints(nnz);
        let mut fl = |n: usize| { let v: Vec<f64> = w[at..at + n].iter().map(|c| f64::from_le_bytes(*c)).collect(); at += n; v };
        let val = fl(nnz); let q = fl(d * c); let mu = fl(c); let mr = fl(c); let ms = fl(c);
        let bounds: Vec<Bounds> = (0..c).map(|i| Bounds { sliding: mu[i], rolling: mr[i], spinning: ms[i] }).collect();
        let (p, _) = Problem::from_csr(&ptr, &col, &val, &q, d, &bounds).unwrap();
        let s = Scaled::new(&p);
        let name = std::path::Path::new(&path).file_stem().unwrap().to_str().unwrap().to_string();
        if mode == "order" {
            for size in [0usize, 1, 16, 32, 64, 128, 256] {
                let mut sw = Sweeps::sized(&s.problem, 1, size);
                let mut y = vec![0.0; p.rows()]; let mut u = y.clone();
                sw.enter(&y);
                print!("{name:40} {c:6} size {size:4} chunks {:5} stages {:3} :", sw.shape().0, sw.shape().1);
                let mut done = 0;
                for n in [10, 30, 60, 120, 240, 480] {
                    sw.sweep(n - done, || false); done = n;
                    sw.leave(&mut y);
                    print!(" {:9.2e}", natural::residual(&s.problem, &y, &mut u));
                }
                println!();
            }
        } else {
            for (size, threads) in [(0usize, 1usize), (1, 1), (32, 1), (32, 2), (64, 1), (64, 2), (128, 1), (128, 2), (256, 1), (256, 2)] {
                if size > 1 && c < 500 { continue; }
                let t = Instant::now();
                let mut sw = Sweeps::sized(&s.problem, threads, size);
                let setup = t.elapsed().as_secs_f64();
                let y = vec![0.0; p.rows()];
                sw.enter(&y);
                sw.sweep(10, || false);
                let mut best = f64::INFINITY;
                let t0 = Instant::now();
                while t0.elapsed().as_secs_f64() < 0.5 {
                    let t = Instant::now();
                    sw.sweep(10, || false);
                    best = best.min(t.elapsed().as_secs_f64() / 10.0);
                }
                println!("{name:40} {c:6} size {size:4} threads {threads} {:9.3e} updates/s {:8.3} us/sweep setup {:.1} sweeps  ns/contact {:.1} blocks/contact {:.1}", c as f64 / best, best * 1e6, setup / best, best / c as f64 * 1e9, s.problem.w.col.len() as f64 / c as f64);
            }
        }
    }
}
