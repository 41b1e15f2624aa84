;; The inner loop of pose_keys.js: columns of 32-bit floats, each times a number, added to a vector of 64-bit floats.
;;
;;   accumulate(outputs, end, columns, values, count):  outputs[i] += sum over k < count of values[k] * columns[k][i]
;;
;; All arguments but the last are addresses, in bytes. `columns` holds an address for each column. Eight outputs are
;; computed at a time: from `outputs` to `end` there are 64 bytes or a multiple of it. `count` is not 0.
(module
  (import "" "memory" (memory 1))
  (func (export "accumulate")
    (param $output i32) (param $end i32) (param $columns i32) (param $values i32) (param $count i32)
    (local $k i32) (local $row i32) (local $weights i32) (local $value v128)
    (local $a v128) (local $b v128) (local $c v128) (local $d v128)
    (loop $eight_outputs
      (local.set $a (v128.load offset=0 (local.get $output)))
      (local.set $b (v128.load offset=16 (local.get $output)))
      (local.set $c (v128.load offset=32 (local.get $output)))
      (local.set $d (v128.load offset=48 (local.get $output)))
      (local.set $k (i32.const 0))
      (loop $each_column
        (local.set $value (v128.load64_splat (i32.add (local.get $values) (i32.shl (local.get $k) (i32.const 3)))))
        (local.set $weights (i32.add (local.get $row)
          (i32.load (i32.add (local.get $columns) (i32.shl (local.get $k) (i32.const 2))))))
        (local.set $a (f64x2.add (local.get $a) (f64x2.mul (local.get $value)
          (f64x2.promote_low_f32x4 (v128.load64_zero offset=0 (local.get $weights))))))
        (local.set $b (f64x2.add (local.get $b) (f64x2.mul (local.get $value)
          (f64x2.promote_low_f32x4 (v128.load64_zero offset=8 (local.get $weights))))))
        (local.set $c (f64x2.add (local.get $c) (f64x2.mul (local.get $value)
          (f64x2.promote_low_f32x4 (v128.load64_zero offset=16 (local.get $weights))))))
        (local.set $d (f64x2.add (local.get $d) (f64x2.mul (local.get $value)
          (f64x2.promote_low_f32x4 (v128.load64_zero offset=24 (local.get $weights))))))
        (br_if $each_column (i32.lt_u (local.tee $k (i32.add (local.get $k) (i32.const 1))) (local.get $count))))
      (v128.store offset=0 (local.get $output) (local.get $a))
      (v128.store offset=16 (local.get $output) (local.get $b))
      (v128.store offset=32 (local.get $output) (local.get $c))
      (v128.store offset=48 (local.get $output) (local.get $d))
      (local.set $row (i32.add (local.get $row) (i32.const 32)))
      (br_if $eight_outputs
        (i32.lt_u (local.tee $output (i32.add (local.get $output) (i32.const 64))) (local.get $end))))))
