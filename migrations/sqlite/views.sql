-- The views of a library in a file: what people ask, and what the program reads by. The numbered migrations make
-- tables; the views that 0001 to 0008 made as well are replaced by these.
--
-- Opening a library makes them anew where `pragma user_version` is smaller than here: whoever changes a view raises
-- the number below and in coordinator/library/src/engine/views.rs. A migration that changes a table drops the views
-- that read it; they are made again after it.
--
-- Columns of parameters are those of the catalogue, in its order; a test compares them.

-- One row a case and speed: what went in, and what came out.
drop view if exists result_with_parameters;
create view result_with_parameters as
select
    result.campaign_id,
    result.sobol_index,
    result.speed_km_h,
    campaign_case.railpad_stiffness_N_m,
    campaign_case.railpad_damping_N_s_m,
    campaign_case.ballast_stiffness_N_m,
    campaign_case.ballast_damping_N_s_m,
    campaign_case.sleeper_EI_N_m2,
    campaign_case.irregularity_level,
    campaign_case.surface_seed,
    result.level_50_Hz_dB,
    result.level_63_Hz_dB,
    result.level_80_Hz_dB,
    result.level_100_Hz_dB,
    result.level_125_Hz_dB,
    result.level_160_Hz_dB,
    result.level_200_Hz_dB,
    result.level_250_Hz_dB,
    result.level_315_Hz_dB,
    result.level_400_Hz_dB,
    result.level_500_Hz_dB,
    result.level_630_Hz_dB,
    result.level_800_Hz_dB,
    result.level_1000_Hz_dB,
    result.level_1250_Hz_dB,
    result.level_1600_Hz_dB,
    result.level_2000_Hz_dB,
    result.level_2500_Hz_dB,
    result.level_3150_Hz_dB,
    result.level_4000_Hz_dB,
    result.log_power,
    result.duration_s,
    result.worker,
    result.code_version,
    result.model_hash,
    result.experiment_hash,
    result.parameter_hash,
    result.finished_at,
    result.flagged,
    result.contact_loss_share,
    result.checksum,
    campaign_case.drawn
from result
join campaign_case using (campaign_id, sobol_index);

-- One row a case, speed and frequency bin: ln LWPS, in (m/s2)^2.
--
-- SQLite has no function that reads a double from a blob; this reads its hexadecimal digits: sign and
-- exponent in three, the mantissa in thirteen. Exact to the bit for values that are 0 or between 2e-22
-- and 4e34; smaller ones read as 0.
drop view if exists spectrum;
create view spectrum as
select
    result.campaign_id,
    result.sobol_index,
    result.speed_km_h,
    frequency_bin.bin,
    frequency_bin.frequency_Hz,
    (
        select
            case when head >= 2048 then -1.0 else 1.0 end * case
                when shift >= 0 then mantissa * (1 << shift)
                when shift >= -62 then mantissa / (1 << -shift)
                when shift >= -124 then mantissa / (1 << 62) / (1 << (-shift - 62))
                else 0.0
            end
        from (
            select
                head,
                (head & 2047) - 1075 as shift,
                cast((1 << 52) + (instr('123456789ABCDEF', substr(digits, 4, 1)) << 48)
                    + (instr('123456789ABCDEF', substr(digits, 5, 1)) << 44)
                    + (instr('123456789ABCDEF', substr(digits, 6, 1)) << 40)
                    + (instr('123456789ABCDEF', substr(digits, 7, 1)) << 36)
                    + (instr('123456789ABCDEF', substr(digits, 8, 1)) << 32)
                    + (instr('123456789ABCDEF', substr(digits, 9, 1)) << 28)
                    + (instr('123456789ABCDEF', substr(digits, 10, 1)) << 24)
                    + (instr('123456789ABCDEF', substr(digits, 11, 1)) << 20)
                    + (instr('123456789ABCDEF', substr(digits, 12, 1)) << 16)
                    + (instr('123456789ABCDEF', substr(digits, 13, 1)) << 12)
                    + (instr('123456789ABCDEF', substr(digits, 14, 1)) << 8)
                    + (instr('123456789ABCDEF', substr(digits, 15, 1)) << 4)
                    + (instr('123456789ABCDEF', substr(digits, 16, 1)) << 0) as real) as mantissa
            from (
                select
                    digits,
                    (instr('123456789ABCDEF', substr(digits, 1, 1)) << 8)
                    + (instr('123456789ABCDEF', substr(digits, 2, 1)) << 4)
                    + instr('123456789ABCDEF', substr(digits, 3, 1)) as head
                from (select hex(substr(result.log_power, 8 * frequency_bin.bin + 1, 8)) as digits)
            )
        )
    ) as log_power
from result
join frequency_bin using (experiment_hash);

-- One row a campaign: how far it is.
drop view if exists campaign_status;
create view campaign_status as
select
    campaign.id as campaign_id,
    campaign.name,
    campaign.state,
    campaign.priority,
    coalesce(sum(case_count.cases), 0) as cases,
    coalesce(sum(case_count.cases) filter (where case_count.state = 'waiting'), 0) as waiting,
    coalesce(sum(case_count.cases) filter (where case_count.state = 'leased'), 0) as leased,
    coalesce(sum(case_count.cases) filter (where case_count.state = 'finished'), 0) as finished,
    coalesce(sum(case_count.cases) filter (where case_count.state = 'failed'), 0) as failed,
    campaign.created_at
from campaign
left join case_count on case_count.campaign_id = campaign.id
group by campaign.id;

-- Cases that were given up, what they were, and why.
drop view if exists failed_case;
create view failed_case as
select
    campaign_id,
    sobol_index,
    railpad_stiffness_N_m,
    railpad_damping_N_s_m,
    ballast_stiffness_N_m,
    ballast_damping_N_s_m,
    sleeper_EI_N_m2,
    irregularity_level,
    surface_seed,
    attempts,
    worker,
    error
from campaign_case
where state = 'failed';

-- Cases finished and failed in each interval of ten seconds, over all coordinators.
drop view if exists campaign_progress;
create view campaign_progress as
select
    campaign_id,
    from_unix_s,
    sum(finished) as finished,
    sum(failed) as failed,
    sum(busy_s) as busy_s
from progress
group by campaign_id, from_unix_s;

pragma user_version = 2;
