// The hold model in ns-3: callbacks scheduled on objects, with the priority queue as scheduler, as
// the fastest of ns-3's own for this. No typed message, identity or digest: an event is a call.
//
//     ns3_hold ACTORS POPULATION EVENTS
//
// Prints how many nanoseconds an event took, between a fifth of EVENTS and all of them.

#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "ns3/core-module.h"

using namespace ns3;

namespace
{

const int64_t LOOK_AHEAD_NS = 100000000;
const double MEAN_NS = 900000000.0;

// PCG with 64 bits of state, as cheap as what the other simulators draw with.
struct Stream
{
    uint64_t state;

    uint32_t Next()
    {
        uint64_t old = state;
        state = old * 6364136223846793005ULL + 1442695040888963407ULL;
        uint32_t mixed = static_cast<uint32_t>(((old >> 18) ^ old) >> 27);
        uint32_t turn = static_cast<uint32_t>(old >> 59);
        return (mixed >> turn) | (mixed << ((-turn) & 31));
    }

    uint64_t Below(uint64_t limit)
    {
        return (static_cast<uint64_t>(Next()) * limit) >> 32;
    }

    double Exponential(double mean)
    {
        double uniform = (Next() + 0.5) / 4294967296.0;
        return -mean * std::log(uniform);
    }
};

// 24 bytes, as in the others.
struct Job
{
    uint64_t id;
    uint64_t hops;
    uint64_t payload;
};

struct Holder;
std::vector<Holder> g_holders;
uint64_t g_handled = 0;
uint64_t g_events = 0;
std::chrono::steady_clock::time_point g_begin;

struct Holder
{
    Stream stream;

    void Pass(Job job)
    {
        Holder* to = &g_holders[stream.Below(g_holders.size())];
        int64_t delay = LOOK_AHEAD_NS + static_cast<int64_t>(stream.Exponential(MEAN_NS));
        Simulator::Schedule(NanoSeconds(delay), &Holder::Receive, to, job);
    }

    void Receive(Job job)
    {
        ++g_handled;
        if (g_handled == g_events / 5)
        {
            g_begin = std::chrono::steady_clock::now();
        }
        if (g_handled == g_events)
        {
            std::chrono::duration<double, std::nano> took =
                std::chrono::steady_clock::now() - g_begin;
            std::printf("%.1f\n", took.count() / static_cast<double>(g_events - g_events / 5));
            Simulator::Stop();
        }
        job.hops += 1;
        Pass(job);
    }
};

} // namespace

int main(int count, char** arguments)
{
    if (count != 4)
    {
        return 2;
    }
    uint64_t actors = std::strtoull(arguments[1], nullptr, 10);
    uint64_t population = std::strtoull(arguments[2], nullptr, 10);
    g_events = std::strtoull(arguments[3], nullptr, 10);
    ObjectFactory scheduler;
    scheduler.SetTypeId("ns3::PriorityQueueScheduler");
    Simulator::SetScheduler(scheduler);
    for (uint64_t at = 0; at < actors; ++at)
    {
        g_holders.push_back(Holder{Stream{at * 0x9e3779b97f4a7c15ULL + 1}});
    }
    for (Holder& holder : g_holders)
    {
        for (uint64_t id = 0; id < population; ++id)
        {
            holder.Pass(Job{id, 0, 0});
        }
    }
    Simulator::Run();
    Simulator::Destroy();
    return 0;
}
