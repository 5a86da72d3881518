//! Benchmark of frustum culling: every contender on 100 thousand and a million boxes, in random and in sorted
//! order, with 11 % and 1 % of the boxes in view.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::{hint::black_box, time::Duration};
use visibility_benches::workload::{FRAMES, Order, Share, boxes, views};
use visibility_benches::{check::verify, contenders};

fn frustum(c: &mut Criterion) {
    for count in [100_000, 1_000_000] {
        for share in Share::ALL {
            for order in Order::ALL {
                let (boxes, views) = (boxes(count, order), views(share));
                let name = format!("frustum/{count}/{}/{}", share.name(), order.name());
                let mut group = c.benchmark_group(name);
                group.throughput(Throughput::Elements(count as u64));
                group.sample_size(10).measurement_time(Duration::from_secs(2));
                group.warm_up_time(Duration::from_millis(500));
                for contender in &mut contenders::all(&boxes, &views) {
                    let mut frame = 0;
                    group.bench_function(BenchmarkId::from_parameter(contender.name()), |b| {
                        // The check is inside the closure, so that benchmarks excluded on the command line
                        // cost nothing.
                        verify(contender.as_mut(), &boxes, &views);
                        b.iter(|| {
                            frame = (frame + 1) % FRAMES;
                            black_box(contender.cull(frame))
                        });
                    });
                }
            }
        }
    }
}

criterion_group!(benches, frustum);
criterion_main!(benches);
