"""The compiled loop: floats, arrays and tuples only. `step`, the law, is put in where the loop is compiled."""
