function z = pretouch_steady_low_pass(p, value)
% States of the low-pass sections in the steady state for a constant input.
    z = zeros(max(p.sections, 1), 2);
    for i = 1:p.sections
        n = p.low_pass(i);
        out = (n.b0 + n.b1 + n.b2) / (1 + n.a1 + n.a2) * value;
        z(i, :) = [out - n.b0 * value, n.b2 * value - n.a2 * out];
        value = out;
    end
end
